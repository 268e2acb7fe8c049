"""One cycle of a loop on one bus: goals out, positions in. This is the hot path; whatever can be known before is.

The exchanges are those of the family's `Train`, and how they are sent decides the bus: on one lane they follow each
other, on several they are all in flight at once. A device that does not answer costs its own reading and no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from motorbus.bus.face import BusFace
from motorbus.bus.pump import Bus
from motorbus.core.family import Positions, Train
from motorbus.core.operation import Exchange, Operation, Pause, Together, outcome
from motorbus.errors import (
    Interrupted,
    LimitExceeded,
    MotionError,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    WireError,
)
from motorbus.motion.capabilities import AxisVerbs, cap
from motorbus.motion.command import Command
from motorbus.motion.loop.place import Place

LOST: Final = (NoReply, WireError, OutcomeUnknown)
"""Ways in which a reading, or the acknowledgement of a goal, is lost and a loop goes on."""
SPIN: Final = 0.0002
"""s before a slot from which on a blocking loop looks at the clock without a pause: no system wakes it that exactly."""


class Part:
    """What a loop does on one bus. `began` and `ended` are those of the last cycle, in s of robot time.

    `origin` is what the clock of its link showed when that of the robot was at 0. Those who wait `exactly` burn the
    processor for the last bit. `command` is over those who are led; `refused` are those of the last orders that could
    not be given, and stay where they are.
    """

    def __init__(self, bus: BusFace, origin: float, places: Sequence[Place], train: Train) -> None:
        self.bus: Final = bus
        self.link: Final = bus.link
        self.origin: Final = origin
        self.places: Final = {place.node: place for place in places}
        self.train: Final = train
        self.reads: Final = tuple(train.positions)
        self.exactly = False
        self.began = self.ended = 0.0
        self.abreast: Final = len({exchange.lane for exchange in self.reads}) > 1
        self.command = Command(())
        self.refused: list[LimitExceeded] = []

    @property
    def now(self) -> float:
        """Robot time by the clock of this bus (s)."""
        return self.link.now() - self.origin

    # -- a cycle -------------------------------------------------------------------------------------------------------

    def orders(self, periods: int) -> Sequence[Exchange[Any]]:
        """The exchanges that order the next small goal of all who are led; see `refused`.

        Raises RequestError when one of them was set up anew, and takes goals of another kind now.
        """
        to: dict[int, float] = {}
        for node, place in self.places.items():
            if place.begun:
                try:
                    to[node] = place.step(periods)
                except LimitExceeded as error:
                    to[node] = place.stay()
                    self.refused.append(error)
        if not to:
            return ()
        guarded = self.command.guarded
        return [guarded(exchange) for exchange in self.train.goals(to)]

    def cycle(self, orders: Sequence[Exchange[Any]], moment: float) -> Operation[list[Any]]:
        """Send these from a moment of robot time on, then ask for all positions; what came of each exchange."""
        for pause in self._wait(moment + self.origin):
            yield from pause
        self.began = self.link.now() - self.origin
        told: list[Any] = []
        wanted = (*orders, *self.reads)
        if self.abreast:
            told = yield from Together([_kept(exchange) for exchange in wanted])
        else:
            for exchange in wanted:
                try:
                    told.append((yield from exchange))
                except LOST as error:
                    told.append(error)
        self.ended = self.link.now() - self.origin
        return told

    def at_once(self, bus: Bus, orders: Sequence[Exchange[Any]], moment: float) -> list[Any]:
        """`cycle` on the only bus there is, where nothing is abreast: each exchange on the short path.

        There is nothing to clean up, so an interruption is raised at once.
        """
        for pause in self._wait(moment + self.origin):
            bus.run(iter(pause))
        self.began = self.link.now() - self.origin
        told: list[Any] = []
        for exchange in (*orders, *self.reads):
            try:
                told.append(bus.run(exchange))
            except LOST as error:
                told.append(error)
        self.ended = self.link.now() - self.origin
        return told

    def _wait(self, moment: float) -> Iterator[Pause]:
        link = self.link
        pause = moment - link.now() - (SPIN if self.exactly else 0.0)
        if pause > 0:
            yield Pause(pause)
        if self.exactly:
            while link.now() < moment:
                pass

    def take(self, told: Sequence[Any]) -> list[str]:
        """Note where they are, by what came of a cycle; the names of those who were not heard."""
        places = self.places
        heard = 0
        at = 0.0
        for found in told:
            if type(found) is Positions:
                at = found.at - self.origin
                for node, angle in found.values.items():
                    place = places[node]
                    place.position = (angle - place.zero) / place.ratio
                    place.heard = at
                    place.silent = 0
                    heard += 1
        return [] if heard == len(places) else self._unheard(told)

    def heard(self, told: Sequence[Any]) -> dict[str, float]:
        """When each was heard (s of robot time) of whom there is a reading among what came of a cycle, by name."""
        return {
            self.places[node].name: found.at - self.origin
            for found in told
            if isinstance(found, Positions)
            for node in found.values
        }

    def _unheard(self, told: Sequence[Any]) -> list[str]:
        heard = {node for found in told if isinstance(found, Positions) for node in found.values}
        missing = [place for node, place in self.places.items() if node not in heard]
        for place in missing:
            place.silent += 1
        return [place.name for place in missing]

    # -- the beginning -------------------------------------------------------------------------------------------------

    def begin(self, fresh: Sequence[Place]) -> Operation[None]:
        """Give these torque without a jump, with the caps of the machine file, and see where they stand.

        Raises Interrupted when somebody else tells one of them something meanwhile: nothing of this leaves any more
        then, so whoever has let an axis go finds it limp.
        """
        axes = [place.axis for place in fresh]
        command = Command(axes)
        train = yield from train_of(self.bus, axes)
        try:
            command.depart()
            angles = yield from _begun(train, command)
        except MotionError as error:
            if lost := set(axes).difference(command.held()):
                raise stopped([axis.name for axis in axes if axis in lost]) from error
            raise
        self.command = self.command.joined(command)
        for place, angle in zip(fresh, angles, strict=True):
            place.begin(place.axis.spec.from_device(angle))

    def brakes(self) -> bool:
        """Whether one of those who follow a goal is not there yet."""
        return any(place.begun and not place.arrived for place in self.places.values())

    def release_lost(self) -> list[str]:
        """Who was told something from elsewhere is led no more; their names. After an emergency stop all of them."""
        self.command = command = Command(()) if self.bus.turns.latched else self.command.rest()
        lost = [place for place in self.places.values() if place.begun and place.axis not in command.axes]
        for place in lost:
            place.release()
        return [place.name for place in lost]


def _begun(train: Train, command: Command) -> Operation[list[float]]:
    """Torque on, and as quick in following as the axis may be; where the device of each stands then (rad)."""

    def ready() -> Operation[None]:
        for axis in command.axes:
            yield from cap(axis)
        speeds = {axis.spec.node: axis.spec.rate_to_device(axis.spec.max_velocity) for axis in command.axes}
        yield from train.begin({node: abs(speed) for node, speed in speeds.items()})

    try:
        yield from command.watched(ready())
        return (yield from Together([axis.able["position"](axis.device) for axis in command.axes]))
    except BaseException:
        for axis in command.held():  # they may have torque, and go nowhere
            axis.arrives()
        raise


def train_of(bus: BusFace, axes: Sequence[AxisVerbs]) -> Operation[Train]:
    """These axes of one bus, ready to be asked and told in a loop; nothing is written."""
    train: Train = yield from axes[0].able["train"]([axis.device for axis in axes], rate=bus.rate)
    return train


def stopped(names: Sequence[str]) -> Interrupted:
    """The error for axes that somebody else has stopped, let go or told to move while they were led."""
    return Interrupted(
        f"{', '.join(names)}: stopped from elsewhere, so the loop gives no more goals",
        cause="while the loop led it, it was stopped, held, let go or told to move by somebody else",
        advice="set a new goal to lead it again; after an emergency stop, reset() first",
    )


def _kept(exchange: Exchange[Any]) -> Operation[Any]:
    """Its value, or the error by which it was lost; every other error is raised when all have ended."""
    found = yield from outcome(exchange)
    if isinstance(found, MotorbusError) and not isinstance(found, LOST):
        raise found
    return found


def silence(names: Sequence[str], cycles: int, places: Mapping[str, Place], now: float) -> NoReply:
    """The error for axes that have not been heard for so many cycles."""
    ages = ", ".join(f"{name} for {now - places[name].heard:.3g} s" for name in names)
    return NoReply(
        f"{', '.join(names)}: no reading in {cycles} cycles of the loop",
        expected="a position of each axis in each cycle",
        cause=f"no power, a loose cable, or too much noise; silent: {ages}",
        advice="see to that; the other axes were left where their goals are",
    )
