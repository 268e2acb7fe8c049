"""The rounds of a loop that is a cycle ahead of what it tells, so that the wire need not wait for the program.

    a round    the next goals are judged and made ready while the last answer is on its way; it comes in, they leave
               at once, and only then is it told what it brought

So a goal that is set when a reading is seen leaves with the cycle after the one that is on the wire by then. Whatever
does not come every day, as torque for who has got his first goal, waits until nothing is in the air, and is done as in
any other loop. Goals that were made ready for somebody who was not heard then, or cannot be believed, do not leave.

A reading that is in is told, whatever keeps the next cycle from leaving: that is raised by the next round.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, NoReturn

from motorbus.bus.loosed import Behind, Loosed
from motorbus.core.family import Positions
from motorbus.core.operation import Exchange
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError
from motorbus.motion.abreast import Abreast
from motorbus.motion.command import Command
from motorbus.motion.loop.braking import Works
from motorbus.motion.loop.grid import Grid
from motorbus.motion.loop.place import Place
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.loop.rounds import Rounds
from motorbus.motion.moving.forgiving import LOST


class Air(NamedTuple):
    """What is in the air: its slot on the grid, when that began (s of robot time), and the volley."""

    number: int
    moment: float
    volley: Loosed


class Owed(NamedTuple):
    """An error that is still to be raised, and who is led no more for it: what they are told meanwhile does not count,
    for whoever tells them something knows nothing of it yet."""

    error: MotorbusError
    lost: list[Place]


class RoundsAhead(Rounds):
    """`Rounds` on the only bus there is, where nothing is abreast."""

    lag = 1
    _air: Air | None = None
    _missing: list[str] | None = None
    _owed: Owed | None = None

    def round(self) -> Generator[Abreast[Any], Any, LoopState]:
        """One cycle leaves, and it is told what the one before it brought. Raises as `Rounds.round`, and before
        anything else what has kept a cycle from leaving when the last one was told.

        At first, for torque, and after an error it is one cycle that leaves and is told, and another one that leaves.
        """
        if self._owed is not None:
            self._pay(self._owed)
        air, grid = self._air, self._grid
        if air is None or grid is None or self._fresh:
            if (down := self._come_down()) is not None:
                self._state(*down)
            state = yield from super().round()
            self._get_ahead()
            return state
        now = self.now
        slot = grid.upcoming(now)
        periods = max(1, slot - self._stepped)
        try:
            self._judge(periods)
        except Interrupted:
            with suppress(MotorbusError):  # whoever has stopped them may have ended the question too
                self._come_down()
            raise
        if self._clamps:
            yield from self._tell_clamps(now)
        orders, self._stepped = self._orders(periods), slot
        told, missing = self._relayed(air, grid, orders)
        return self._state(told, missing, air.number)

    def leaving(self) -> Works:
        """As `Rounds.leaving`, when what is in the air has come down."""
        try:
            with suppress(Interrupted):  # nobody is led by then whom that concerns
                self._come_down()
        finally:
            yield from super().leaving()
        if (owed := self._owed) is not None and not isinstance(owed.error, Interrupted | LimitExceeded):
            self._pay(owed)

    def _pay(self, owed: Owed) -> NoReturn:
        self._owed = None
        for place in owed.lost:
            place.release()
        raise owed.error

    def _owe(self, error: MotorbusError, led: Iterable[Command]) -> None:
        """Raise this later; until now there was this command over those who are led."""
        axes = [axis for command in led for axis in command.axes]
        lost = [place for place in self._all if place.axis in axes and not place.begun]
        self._owed = Owed(error, lost)

    def _get_ahead(self) -> None:
        """The next cycle leaves behind one that is to be told; what is against it is owed."""
        led = [part.command for part in self.parts.values()]
        try:
            self._judge(1)
            orders = self._orders(1)
        except MotorbusError as error:
            self._owe(error, led)
        else:
            self._stepped += 1
            self._leave(orders)

    def _relayed(
        self, air: Air, grid: Grid, orders: dict[str, Sequence[Exchange[Any]]]
    ) -> tuple[dict[str, Any], list[str]]:
        """What is in the air comes down, and the next cycle leaves: at once, where its slot has begun by then."""
        ((bus, part),) = self.parts.items()
        self._missing = None
        behind = None
        if part.watch is None or part.watch.due(part.link.now(), 0.0) is None:
            behind = air.volley.behind(orders[bus], grid.begins(grid.number + 1) + part.origin, self._fits)
        told = self._landed(air, behind)
        self._count(air.moment)
        missing = self._heard(told) if self._missing is None else self._missing
        if behind is None or behind.at is None:
            self._leave(orders, None if part.unsure else behind, air)
        else:
            part.began = behind.at - part.origin
            moment = grid.take(part.began)
            self._air = Air(grid.number, moment, air.volley)
        return told, missing

    def _fits(self, found: Any) -> bool:
        """Note this reading; whether everybody may be ordered who was before it."""
        (part,) = self.parts.values()
        self._missing = part.take((found,))
        return not part.unsure

    def _come_down(self) -> tuple[dict[str, Any], list[str], int] | None:
        """What is in the air comes down, and nothing follows it: what it brought, who is missing, and its number."""
        if (air := self._air) is None:
            return None
        told = self._landed(air)
        self._count(air.moment)
        return told, self._heard(told), air.number

    def _landed(self, air: Air, behind: Behind | None = None) -> dict[str, Any]:
        ((bus, part),) = self.parts.items()
        self._air = None
        found: Any
        try:
            found = air.volley.land(behind)
        except MotorbusError as failure:
            found = failure
        came = (
            [one.at - part.origin for one in found if type(one) is Positions] if type(found) is list else []
        )
        part.ended = came[0] if came else part.now
        return {bus: found}

    def _believed(self, orders: dict[str, Sequence[Exchange[Any]]]) -> Sequence[Exchange[Any]]:
        """These, without those of whom nobody knows any more where they are."""
        ((bus, part),) = self.parts.items()
        if part.unsure and (lost := part.withheld()):
            for name in lost:
                self.statistics.unordered[name] += 1
            return part.ordering(part.to)
        return orders[bus]

    def _leave(
        self,
        orders: dict[str, Sequence[Exchange[Any]]],
        behind: Behind | None = None,
        air: Air | None = None,
    ) -> None:
        """The next cycle leaves at its time, as it is ready `behind` the last one where that still holds.

        What goes wrong is owed; nothing is in the air then.
        """
        ((bus, part),) = self.parts.items()
        led = part.command
        assert self._grid is not None
        assert self.only is not None
        moment = self._grid.take(self.now)
        try:
            believed = self._believed(orders)
            part.await_slot(self.only, moment)
            if behind is not None and air is not None and air.volley.leave(behind):
                volley = air.volley
            else:
                volley = Loosed(self.only, (*believed, *part.reads), LOST)
        except MotorbusError as failure:
            try:
                self._fail({bus: failure})
            except MotorbusError as error:
                self._owe(error, [led])
            return
        self._air = Air(self._grid.number, moment, volley)
