"""One cycle of a loop on one bus: goals out, positions in. This is the hot path; whatever can be known before is.

The exchanges are those of the family's `Train`, and how they are sent decides the bus: on one lane they follow each
other, on several they are all in flight at once. A device that does not answer costs its own reading and no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final, TypeVar

from motorbus.bus.face import BusFace
from motorbus.bus.pump import Bus
from motorbus.core.family import Positions, Train
from motorbus.core.operation import Exchange, Operation, Pause, Refusal, Stops, Together, outcome
from motorbus.errors import Interrupted, MotorbusError, NoReply, OutcomeUnknown, WireError
from motorbus.motion.axis import AxisVerbs, cap
from motorbus.motion.place import Place

T = TypeVar("T")

LOST: Final = (NoReply, WireError, OutcomeUnknown)
"""Ways in which a reading, or the acknowledgement of a goal, is lost and a loop goes on."""
SPIN: Final = 0.0002
"""s before a slot from which on a blocking loop looks at the clock without a pause: no system wakes it that exactly."""


class Part:
    """What a loop does on one bus. `began` and `ended` are those of the last cycle, in s of robot time.

    `origin` is what the clock of its link showed when that of the robot was at 0. Those who wait `exactly` burn the
    processor for the last bit.
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
        self._stops: dict[int, int] = {}
        self._stopping = 0

    @property
    def now(self) -> float:
        """Robot time by the clock of this bus (s)."""
        return self.link.now() - self.origin

    # -- a cycle -------------------------------------------------------------------------------------------------------

    def orders(self, periods: int) -> Sequence[Exchange[Any]]:
        """The exchanges that order the next small goal of all who are led. Raises LimitExceeded; see `Place.step`."""
        to = {node: place.step(periods) for node, place in self.places.items() if place.begun}
        if not to:
            return ()
        return [_guarded(exchange, self._stopped_since) for exchange in self.train.goals(to)]

    def cycle(
        self, orders: Sequence[Exchange[Any]], moment: float, *, reads: bool = True
    ) -> Operation[list[Any]]:
        """Send these from a moment of robot time on, then ask for all positions; what came of each exchange."""
        for pause in self._wait(moment + self.origin):
            yield from pause
        self.began = self.link.now() - self.origin
        told: list[Any] = []
        wanted = (*orders, *self.reads) if reads else orders
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

    def _unheard(self, told: Sequence[Any]) -> list[str]:
        heard = {node for found in told if isinstance(found, Positions) for node in found.values}
        missing = [place for node, place in self.places.items() if node not in heard]
        for place in missing:
            place.silent += 1
        return [place.name for place in missing]

    # -- the beginning -------------------------------------------------------------------------------------------------

    def begin(self, fresh: Sequence[Place]) -> Operation[None]:
        """Give these torque without a jump, with the caps of the machine file, and see where they stand."""
        axes = [place.axis for place in fresh]
        train = yield from train_of(self.bus, axes)
        for axis in axes:
            yield from cap(axis)
        for axis in axes:
            axis.departs()
        yield from train.begin(
            {axis.spec.node: abs(axis.spec.rate_to_device(axis.spec.max_velocity)) for axis in axes}
        )
        known = self.bus.turns.known
        if self._stopping != known.stopping and not self.stopped():
            self._stopping = known.stopping
        self._stops.update((place.node, known.stops(place.node)) for place in fresh)
        for place in fresh:
            angle: float = yield from place.axis.able["position"](place.axis.device)
            place.begin(place.axis.spec.from_device(angle))

    def has(self, places: Sequence[Place]) -> bool:
        """Whether one of these is here."""
        return any(place in self.places.values() for place in places)

    def stopped(self) -> list[Place]:
        """Those who were led, and were stopped since or let go; all of them after an emergency stop."""
        turns = self.bus.turns
        return [
            place
            for node, place in self.places.items()
            if place.begun
            and (turns.latched or place.interrupted or turns.known.stops(node) != self._stops[node])
        ]

    def _stopped_since(self, stops: Stops) -> MotorbusError | None:
        if self.bus.turns.known.stopping == self._stopping:
            return None
        for node, before in self._stops.items():
            if stops(node) != before and self.places[node].begun:
                return stopped([self.places[node].name])
        return None


def train_of(bus: BusFace, axes: Sequence[AxisVerbs]) -> Operation[Train]:
    """These axes of one bus, ready to be asked and told in a loop; nothing is written."""
    train: Train = yield from axes[0].able["train"]([axis.device for axis in axes], rate=bus.rate)
    return train


def stopped(names: Sequence[str]) -> Interrupted:
    """The error for axes that somebody has stopped, or let go, while they were led."""
    return Interrupted(
        f"{', '.join(names)}: stopped from elsewhere, so the loop gives no more goals",
        cause="stop(), hold() or disable_torque() was called while the loop led it, or another program stopped it",
        advice="set a new goal to lead it again; after an emergency stop, reset() first",
    )


def straight(bus: Bus, operation: Operation[T]) -> T:
    """Carry out an operation on the only bus there is, each of its exchanges on the short path.

    Only for one that has nothing to clean up: an interruption is raised at once.
    """
    step = next(operation)
    try:
        while True:
            try:
                value = bus.run(step if isinstance(step, Exchange) else iter(step))
            except MotorbusError as error:
                step = operation.throw(error)
            else:
                step = operation.send(value)
    except StopIteration as end:
        found: T = end.value
        return found


def _kept(exchange: Exchange[Any]) -> Operation[Any]:
    """Its value, or the error by which it was lost; every other error is raised when all have ended."""
    found = yield from outcome(exchange)
    if isinstance(found, MotorbusError) and not isinstance(found, LOST):
        raise found
    return found


def _guarded(exchange: Exchange[Any], stopped: Refusal) -> Exchange[Any]:
    """The same, and it does not leave once one of those it orders was stopped; asked when it leaves, so nothing can
    come in between."""
    return Exchange(
        exchange.request,
        exchange.replies,
        exchange.read,
        lane=exchange.lane,
        rank=exchange.rank,
        effect=exchange.effect,
        goals=exchange.goals,
        timeout=exchange.timeout,
        repeatable=exchange.repeatable,
        refusal=stopped if exchange.refusal is None else partial(_either, stopped, exchange.refusal),
    )


def _either(first: Refusal, second: Refusal, stops: Stops) -> MotorbusError | None:
    return first(stops) or second(stops)


def silence(names: Sequence[str], cycles: int, places: Mapping[str, Place], now: float) -> NoReply:
    """The error for axes that have not been heard for so many cycles."""
    ages = ", ".join(f"{name} for {now - places[name].heard:.3g} s" for name in names)
    return NoReply(
        f"{', '.join(names)}: no reading in {cycles} cycles of the loop",
        expected="a position of each axis in each cycle",
        cause=f"no power, a loose cable, or too much noise; silent: {ages}",
        advice="see to that; the other axes were left where their goals are",
    )
