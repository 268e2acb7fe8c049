"""What a loop does, one piece of work after the other, for whoever carries it out: blocking or on an event loop.

    entering   the devices are asked for what a loop must know, and where they are; nothing is written
    a round    goals out, positions in; before it, in a cycle of its own, torque for axes with their first goal
    leaving    axes that are on their way brake

Each is a generator that yields work on several buses and is sent what came of it. Nothing moves before a goal is set.
A goal that must not be sent ends its round before anything leaves, and who was stopped from elsewhere gets no goal any
more.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from math import isfinite
from types import MappingProxyType
from typing import Any, Final, TypeAlias

from motorbus.bus.pump import Bus
from motorbus.core.operation import Operation
from motorbus.errors import Interrupted, MotorbusError, RequestError
from motorbus.motion import limits
from motorbus.motion.abreast import Abreast, settled
from motorbus.motion.axis import AxisVerbs
from motorbus.motion.body import Body
from motorbus.motion.budget import RobotBudget, bus_budget, divided, refuse_above
from motorbus.motion.cycle import Part, silence, stopped, train_of
from motorbus.motion.grid import Grid, Statistics
from motorbus.motion.limits import Device
from motorbus.motion.place import Place
from motorbus.motion.several import named

Works: TypeAlias = "Generator[Abreast[Any], Any, Any]"

PATIENCE: Final = 5
"""Cycles in a row in which an axis may be silent; in the next one the loop raises NoReply."""
NOBODY: Final[frozenset[str]] = frozenset()


class LoopState:
    """What one cycle of a loop brought.

    `at`        when the readings were in, s of robot time
    `number`    of its slot on the grid of the loop; slots that were skipped are missing
    `position`  where each axis is (rad, m) by name, as it was heard last
    `missing`   the names of those that were not heard in this cycle
    """

    __slots__ = ("_heard", "at", "missing", "number", "position")

    def __init__(
        self,
        at: float,
        number: int,
        position: Mapping[str, float],
        missing: frozenset[str],
        heard: Mapping[str, float],
    ) -> None:
        self.at = at
        self.number = number
        self.position = position
        self.missing = missing
        self._heard = heard

    @property
    def age(self) -> dict[str, float]:
        """How old the position of each axis is (s), by name."""
        return {name: max(0.0, self.at - self._heard.get(name, self.at)) for name in self.position}

    def __repr__(self) -> str:
        silent = f", missing {', '.join(sorted(self.missing))}" if self.missing else ""
        return f"<LoopState {self.number} at {self.at:.6g} s{silent}>"


class Rounds:
    """The work of one loop over a machine; `exactly` as `Part` says.

    `places` and `statistics` are there once it has been entered; `only` is set by a blocking loop on the only bus there
    is, where a round then carries its cycle out itself. `without` are the axes that cannot be in a loop.
    """

    def __init__(
        self,
        body: Body,
        rate: float,
        axes: str | Iterable[str] | None,
        *,
        direct: bool,
        jerk: float | None,
        exactly: bool,
    ) -> None:
        if not (isfinite(rate) and rate > 0):
            raise RequestError(
                f"rate is {rate}", expected="a finite number of Hz, above 0", advice="nothing was sent"
            )
        if direct and jerk is not None:
            raise RequestError(
                "jerk is said of goals that are sent as they are",
                expected="jerk, or direct=True",
                advice="leave direct out; nothing was sent",
            )
        led, self.without = divided(body.chosen(axes))
        if not led:
            raise RequestError(
                "none of these axes can be in a loop",
                expected="an axis whose device can be led",
                cause=f"{', '.join(self.without) or 'no axis'}: nobody can lead such a device by small goals",
                advice="move() moves it by a profile of its own; nothing was sent",
            )
        self.rate: Final = rate
        self.places: dict[str, Place] = {}
        self.parts: dict[str, Part] = {}
        self.statistics: Final = Statistics.of(rate, led, body.by_bus(led))
        self.budget: RobotBudget | None = None
        self._body = body
        self._led = led
        self._direct = direct
        self._jerk = jerk
        self._exactly = exactly
        self._grid: Grid | None = None
        self._stepped = 0
        self._fresh = False
        self._all: tuple[Place, ...] = ()
        self._one: Part | None = None
        self.only: Bus | None = None

    @property
    def now(self) -> float:
        """Robot time (s), by the latest clock of its buses."""
        return self._one.now if self._one is not None else max([part.now for part in self.parts.values()])

    @property
    def parts_abreast(self) -> bool:
        """Several exchanges of a bus may be in flight at once."""
        return any(part.abreast for part in self.parts.values())

    # -- entering ------------------------------------------------------------------------------------------------------

    def entering(self) -> Works:
        """Ask what must be known, refuse a rate that cannot be, and see where everybody is."""
        parts = self._body.by_bus(self._led)
        opened = yield Abreast({bus: self._opening(bus, there) for bus, there in parts.items()}, settled)
        self.budget = RobotBudget(self.rate, {bus: found[2] for bus, found in opened.items()}, self.without)
        refuse_above(self.budget)
        for bus, (train, devices, _) in opened.items():
            there = [self._place(axis, devices[axis.name]) for axis in parts[bus]]
            face = self._body.buses[bus]
            self.parts[bus] = Part(face, self._body.origins[bus], there, train)
            self.parts[bus].exactly = self._exactly and not face.link.virtual
        self._one = next(iter(self.parts.values())) if len(self.parts) == 1 else None
        self.places = {name: place for name in self._led for place in self._placed() if place.name == name}
        self._all = tuple(self.places.values())
        yield from self._first_look()

    def _opening(self, bus: str, there: list[AxisVerbs]) -> Operation[Any]:
        try:
            return (yield from self._opened(bus, there))
        except MotorbusError as error:
            name = next((axis.name for axis in there if axis.spec.node == error.node), bus)
            raise named(name, error) from error

    def _opened(self, bus: str, there: list[AxisVerbs]) -> Operation[Any]:
        face = self._body.buses[bus]
        train = yield from train_of(face, there)
        devices: dict[str, Device] = {}
        angles: dict[int, float] = {}
        for axis in there:
            device = devices[axis.name] = yield from limits.of_device(axis)
            angles[axis.spec.node] = 0.0 if device is None else min(max(0.0, device[0]), device[1])
        return train, devices, bus_budget(face, train, [axis.name for axis in there], angles)

    def _place(self, axis: AxisVerbs, device: Device) -> Place:
        return Place(axis, device, 1 / self.rate, self._direct, self._jerk)

    def _placed(self) -> Iterable[Place]:
        return (place for part in self.parts.values() for place in part.places.values())

    def _first_look(self) -> Works:
        unheard = set(self.places)
        for _ in range(PATIENCE + 1):
            told = yield Abreast({bus: part.cycle((), 0.0) for bus, part in self.parts.items()}, settled)
            for bus, part in self.parts.items():
                missing = part.take(told[bus])
                unheard -= {place.name for place in part.places.values()} - set(missing)
            if not unheard:
                return
        raise silence(sorted(unheard), PATIENCE + 1, self.places, self.now)

    # -- a round -------------------------------------------------------------------------------------------------------

    def ask(self, name: str, goal: float) -> None:
        """Set the goal (rad, m) of an axis for the rounds to come. Raises RequestError for what is none of it."""
        place = self.places.get(name)
        if place is None or type(goal) is not float:
            goal = self.check(name, goal)
            place = self.places[name]
        place.asked = goal
        if not place.begun:
            self._fresh = True

    def check(self, name: str, goal: float) -> float:
        """Raise RequestError for an axis that is not in the loop, or what is no number."""
        if name not in self.places:
            known = ", ".join(self._led)
            why = "cannot be led" if name in self.without else "is not in this loop"
            raise RequestError(f"{name} {why}", expected=f"one of {known}", advice="nothing was sent")
        return _number(name, goal)

    def round(self) -> Generator[Abreast[Any], Any, LoopState]:
        """One cycle. Raises LimitExceeded for a goal that must not be sent: then nothing was, and it may go on.

        Raises Interrupted for who was stopped from elsewhere, NoReply for who is silent too long, and what else a bus
        raises.
        """
        grid = self._grid
        if grid is None:
            grid = self._grid = Grid(self.statistics, self.now)
        now = self.now
        periods = max(1, grid.upcoming(now) - self._stepped)
        self._judge(periods)
        if self._fresh and (fresh := self._unbegun()):
            yield from self._begin(fresh)
            grid.forgive(self.now)
            now, periods = self.now, 1
        moment = grid.take(now)
        orders = {bus: part.orders(periods) for bus, part in self.parts.items()}
        self._stepped = grid.number
        if self.only is None:
            told = yield Abreast(
                {bus: part.cycle(orders[bus], moment) for bus, part in self.parts.items()}, dict
            )
        else:
            told = self._at_once(self.only, orders, moment)
        return self._taken(told, moment, grid.number)

    def _at_once(self, only: Bus, orders: Mapping[str, Any], moment: float) -> dict[str, Any]:
        ((name, part),) = self.parts.items()
        try:
            return {name: part.at_once(only, orders[name], moment)}
        except MotorbusError as failure:
            return {name: failure}

    def _judge(self, periods: int) -> None:
        """Before anything is sent: has somebody been stopped, and may all goals be sent?"""
        every = self._all
        for place in every:
            if place.begun:
                axis = place.axis
                if not (axis.under_way and axis.engaged):
                    self._release_interrupted()
        for place in every:
            if place.asked is not None:
                place.judge(periods)

    def _release_interrupted(self) -> None:
        halted = [place for place in self._all if place.interrupted]
        for place in halted:
            place.release()
        raise stopped([place.name for place in halted])

    def _unbegun(self) -> dict[str, list[Place]]:
        """Who has a goal and no torque yet, by bus."""
        self._fresh = False
        return {
            bus: found
            for bus, part in self.parts.items()
            if (found := [one for one in part.places.values() if one.asked is not None and not one.begun])
        }

    def _begin(self, fresh: Mapping[str, list[Place]]) -> Works:
        self._fresh = True
        try:
            yield Abreast({bus: self.parts[bus].begin(there) for bus, there in fresh.items()}, settled)
        except MotorbusError:
            for place in self._all:
                if not place.begun:
                    place.release()
            self._fresh = False
            raise
        self._fresh = False
        self.statistics.begun += 1

    def _taken(self, told: Mapping[str, Any], moment: float, number: int) -> LoopState:
        statistics = self.statistics
        statistics.cycles += 1
        parts = self.parts
        if len(parts) == 1:
            ((bus, part),) = parts.items()
            first, last = part.began, part.ended
            statistics.buses[bus].add(last - first)
        else:
            first = min([part.began for part in parts.values()])
            last = max([part.ended for part in parts.values()])
            for bus, part in parts.items():
                statistics.buses[bus].add(part.ended - part.began)
        statistics.lateness.add(max(0.0, first - moment))
        statistics.cycle.add(last - first)
        missing: list[str] = []
        failed = False
        for bus, part in parts.items():
            found = told[bus]
            if isinstance(found, MotorbusError):
                failed = True
            else:
                missing += part.take(found)
        if failed:
            self._fail(told)
        return self._state(last, number, missing)

    def _fail(self, told: Mapping[str, Any]) -> None:
        """A bus has raised: who was stopped there is led no more."""
        for bus, found in told.items():
            if isinstance(found, Interrupted):
                for place in self.parts[bus].stopped():
                    place.release()
        settled(told)

    def _state(self, at: float, number: int, missing: list[str]) -> LoopState:
        position = {place.name: place.position for place in self._all}
        if not missing:
            return LoopState(at, number, position, NOBODY, _NEVER)
        for name in missing:
            self.statistics.lost[name] += 1
        silent = [name for name in missing if self.places[name].silent > PATIENCE]
        if silent:
            error = silence(silent, PATIENCE + 1, self.places, at)
            for name in silent:
                self.places[name].silent = 0
            raise error
        heard = {name: self.places[name].heard for name in missing}
        return LoopState(at, number, position, frozenset(missing), heard)

    # -- leaving -------------------------------------------------------------------------------------------------------

    def leaving(self) -> Works:
        """Those that follow a goal and are on their way brake, as hard as they may, and stay where that ends.

        Who was stopped from elsewhere is left alone, and so is whoever can be told nothing any more.
        """
        grid = self._grid
        if grid is None:
            return
        for part in self.parts.values():
            for place in part.stopped():
                place.release()
        led = {place.name for place in self._all if place.begun and not self._direct}
        braking = [place for place in self._all if place.halt()]
        parts = {bus: part for bus, part in self.parts.items() if part.has(braking)}
        failures: dict[str, Any] = {}
        while parts and not all(place.arrived for place in braking):
            grid.forgive(self.now)
            moment = grid.take(self.now)
            told = yield Abreast(
                {bus: part.cycle(part.orders(1), moment, reads=False) for bus, part in parts.items()}, dict
            )
            failures |= {bus: found for bus, found in told.items() if isinstance(found, MotorbusError)}
            parts = {bus: part for bus, part in parts.items() if bus not in failures}
            braking = [place for place in braking if place.axis.spec.bus in parts]
        for place in self._all:
            if place.name in led and place.axis.spec.bus not in failures:
                place.axis.arrives()
        settled(failures)


_NEVER: Final[Mapping[str, float]] = MappingProxyType({})


def _number(name: str, goal: object) -> float:
    if isinstance(goal, bool) or not isinstance(goal, int | float):
        raise RequestError(
            f"the goal of {name} is {goal!r}", expected="a number (rad, m)", advice="nothing was sent"
        )
    return float(goal)
