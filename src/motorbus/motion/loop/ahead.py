"""The rounds of a loop that is a cycle ahead of what it tells, so that the wire need not wait for the program.

    a round    the next goals are judged and made ready while the last answer is on its way; it comes in, they leave
               at once, and only then is it told what it brought

So a goal that is set when a reading is seen leaves with the cycle after the one that is on the wire by then. Whatever
does not come every day, as torque for who has got his first goal, waits until nothing is in the air, and is done as in
any other loop. Goals that were made ready for somebody who was not heard then, or cannot be believed, do not leave.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, NamedTuple

from motorbus.bus.loosed import Loosed
from motorbus.core.operation import Exchange
from motorbus.errors import MotorbusError
from motorbus.motion.abreast import Abreast
from motorbus.motion.loop.braking import Works
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.loop.rounds import Rounds
from motorbus.motion.moving.forgiving import LOST


class Air(NamedTuple):
    """What is in the air: its slot on the grid, when that began (s of robot time), and the volley."""

    number: int
    moment: float
    volley: Loosed


class RoundsAhead(Rounds):
    """`Rounds` on the only bus there is, where nothing is abreast."""

    lag = 1
    _air: Air | None = None

    def round(self) -> Generator[Abreast[Any], Any, LoopState]:
        """One cycle leaves, and it is told what the one before it brought. Raises as `Rounds.round`.

        At first, for torque, and after an error it is one cycle that leaves and is told, and another one that leaves.
        """
        air = self._air
        if air is None or self._fresh:
            self._come_down()
            state = yield from super().round()
            self._judge(1)
            orders = self._orders(1)
            self._stepped += 1
            self._leave(self._believed(orders))
            return state
        grid, now = self._grid, self.now
        assert grid is not None
        slot = grid.upcoming(now)
        periods = max(1, slot - self._stepped)
        self._judge(periods)
        if self._clamps:
            yield from self._tell_clamps(now)
        orders, self._stepped = self._orders(periods), slot
        told = self._landed(air)
        missing = self._heard(told, air.moment)
        self._leave(self._believed(orders))
        return self._state(told, missing, air.number)

    def leaving(self) -> Works:
        """As `Rounds.leaving`, when what is in the air has come down."""
        try:
            self._come_down()
        finally:
            yield from super().leaving()

    def _come_down(self) -> None:
        if self._air is not None:
            moment = self._air.moment
            self._heard(self._landed(self._air), moment)

    def _landed(self, air: Air) -> dict[str, Any]:
        ((bus, part),) = self.parts.items()
        self._air = None
        found: Any
        try:
            found = air.volley.land()
        except MotorbusError as failure:
            found = failure
        part.ended = part.now
        return {bus: found}

    def _believed(self, orders: dict[str, Sequence[Exchange[Any]]]) -> Sequence[Exchange[Any]]:
        """These, without those of whom nobody knows any more where they are."""
        ((bus, part),) = self.parts.items()
        if part.unsure and (lost := part.withheld()):
            for name in lost:
                self.statistics.unordered[name] += 1
            return part.ordering(part.to)
        return orders[bus]

    def _leave(self, orders: Sequence[Exchange[Any]]) -> None:
        """The next cycle leaves at its time. Raises what went wrong; nothing is in the air then."""
        ((bus, part),) = self.parts.items()
        assert self._grid is not None
        assert self.only is not None
        moment = self._grid.take(self.now)
        try:
            part.await_slot(self.only, moment)
            volley = Loosed(self.only, (*orders, *part.reads), LOST)
        except MotorbusError as failure:
            self._fail({bus: failure})
            raise
        self._air = Air(self._grid.number, moment, volley)
