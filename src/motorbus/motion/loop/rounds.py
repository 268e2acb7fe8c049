"""What a loop does, one piece of work after the other, for whoever carries it out: blocking or on an event loop.

    entering   the devices are asked for what a loop must know, and where they are; nothing is written
    a round    goals out, positions in; before it, in a cycle of its own, torque for axes with their first goal
    leaving    axes that are on their way brake

Each is a coroutine that awaits work on several buses. Nothing moves before a goal is set.
A goal that must not be sent ends its round before anything leaves. Who was stopped from elsewhere, or told to move,
gets no goal any more: who told it last has the command. So it is with two loops that lead the same axis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from motorbus.bus.blocking import Bus, exchange_on
from motorbus.core.request import Request
from motorbus.core.steps import Emit
from motorbus.errors import Faulted, Interrupted, LinkLost, MotorbusError, Overloaded, RequestError
from motorbus.motion import limits
from motorbus.motion.body import Body
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.clamping import Clamped, Policy, Tidings, check_policy
from motorbus.motion.command import Command
from motorbus.motion.limits import Device
from motorbus.motion.loop.braking import braked, latest, refusals
from motorbus.motion.loop.cycle import Part, divided, train_of
from motorbus.motion.loop.errors import as_number, check_loop, silence, stopped
from motorbus.motion.loop.grid import Grid, Statistics
from motorbus.motion.loop.place import CATCH_UP, Place
from motorbus.motion.loop.readings import PATIENCE, SILENCE, LoopState, state_of
from motorbus.motion.moving.forgiving import LOST
from motorbus.motion.parallel import Parallel, settled
from motorbus.motion.safety.watch import Watch
from motorbus.motion.several import named

RELEASES: Final = (Interrupted, Faulted, Overloaded)
"""Errors after which it is seen who is not to be led any more."""


class Rounds:
    """The work of one loop over a machine; `exactly` as `Part` says.

    `places` and `statistics` are there once it has been entered; `buses` are set by a blocking loop, which carries
    its cycles out itself. `without` are the axes that cannot be in a loop.
    """

    def __init__(
        self,
        body: Body,
        rate: float,
        axes: str | Iterable[str] | None,
        *,
        direct: bool,
        exactly: bool,
        policy: Policy = "reject",
        watch: bool = True,
    ) -> None:
        check_loop(rate)
        check_policy(policy)
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
        self._body = body
        self._led = led
        self._direct = direct
        self._exactly = exactly
        self._policy = policy
        self._watch = watch
        self._clamps: list[Clamped] = []
        self._tidings = Tidings()
        self._grid: Grid | None = None
        self._entered = self._left = False
        self._askable: Mapping[str, Place] = {}
        self._stepped = 0
        self._fresh = False
        self._all: tuple[Place, ...] = ()
        self._one: Part | None = None
        self.buses: dict[str, Bus] = {}

    @property
    def now(self) -> float:
        """Robot time (s), by the latest clock of its buses."""
        return self._one.now if self._one is not None else latest(self.parts.values())

    # -- entering ------------------------------------------------------------------------------------------------------

    async def entering(self) -> None:
        """Ask what must be known, and see where everybody is."""
        if self._entered:
            raise RequestError(
                "the loop was entered before", expected="a new one for each `with`", advice="nothing was sent"
            )
        parts = self._body.by_bus(self._led)
        opened = await Parallel({bus: self._opening(bus, there) for bus, there in parts.items()}, settled)
        for bus, (train, devices) in opened.items():
            there = [self._place(axis, devices[axis.name]) for axis in parts[bus]]
            face = self._body.buses[bus]
            watch = Watch(face, parts[bus]) if self._watch else None
            self.parts[bus] = Part(face, self._body.origins[bus], there, train, watch)
            self.parts[bus].exactly = self._exactly and not face.link.virtual
        self._one = next(iter(self.parts.values())) if len(self.parts) == 1 else None
        self.places = {name: place for name in self._led for place in self._placed() if place.name == name}
        self._all = tuple(self.places.values())
        await self._first_look()
        self._askable = self.places
        self._entered = True

    async def _opening(self, bus: str, there: list[AxisVerbs]) -> Any:
        try:
            return await self._opened(bus, there)
        except MotorbusError as error:
            name = next((axis.name for axis in there if axis.spec.node == error.node), bus)
            raise named(name, error) from error

    async def _opened(self, bus: str, there: list[AxisVerbs]) -> Any:
        face = self._body.buses[bus]
        train = await train_of(face, there)
        devices: dict[str, Device] = {axis.name: await limits.of_device(axis) for axis in there}
        return train, devices

    def _place(self, axis: AxisVerbs, device: Device) -> Place:
        place = Place(axis, device, 1 / self.rate, self._direct, self._policy)
        place.clamps = self._clamps
        return place

    def _placed(self) -> Iterable[Place]:
        return (place for part in self.parts.values() for place in part.places.values())

    async def _first_look(self) -> None:
        unheard, begun, looks = set(self.places), self.now, 0
        while looks <= PATIENCE or self.now < begun + SILENCE:
            looks += 1
            told = await Parallel({bus: part.cycle((), 0.0) for bus, part in self.parts.items()}, settled)
            for bus, part in self.parts.items():
                missing = part.take(told[bus])
                unheard -= {place.name for place in part.places.values()} - set(missing)
            if not unheard:
                return
        raise silence(sorted(unheard), looks, self.places, self.now)

    # -- a round -------------------------------------------------------------------------------------------------------

    def ask(self, name: str, goal: float) -> None:
        """Set the goal (rad, m) of an axis for the rounds to come. Raises RequestError for what is none of it."""
        place = self._askable.get(name)
        if place is None or type(goal) is not float:
            goal = self.check(name, goal)
            place = self.places[name]
        if not place.begun:
            limits.refuse_slow(self.rate)
            place.claim = Command((place.axis,))
            self._fresh = True
        place.asked = goal

    def check(self, name: str, goal: float) -> float:
        """Raise RequestError for an axis that is not in the loop, what is no number, and outside the `with`."""
        self._refuse_outside()
        if name not in self.places:
            known = ", ".join(self._led)
            why = "cannot be led" if name in self.without else "is not in this loop"
            raise RequestError(f"{name} {why}", expected=f"one of {known}", advice="nothing was sent")
        return as_number(name, goal)

    async def round(self) -> LoopState:
        """One cycle. Raises LimitExceeded for a goal that must not be sent: then nothing was, and it may go on.

        It is raised at the end of the cycle for an axis that is held back: that one stays, and the others go on. Raises
        Interrupted for who was told something from elsewhere, NoReply for who is silent too long, RequestError outside
        the `with`, and what else a bus raises.
        """
        grid = self._grid
        if grid is None:
            self._refuse_outside()
            grid = self._grid = Grid(self.statistics, self.now)
        now = self.now
        periods = max(1, grid.upcoming(now) - self._stepped)
        self._judge(periods)
        if self._clamps:
            await self._tell_clamps(now)
        if self._fresh and (fresh := self._unbegun()):
            grid.book(now)
            try:
                await self._begin(fresh)
            finally:
                now, periods = self.now, 1
                grid.forgive(now)
                self._stand(grid.upcoming(now) - self._stepped)
        moment = grid.take(now)
        self._stepped = grid.number
        orders = self._orders(periods)
        if self.buses:
            told = self._exchange(self.buses, orders, moment)
        else:
            told = await Parallel(
                {bus: part.cycle(orders[bus], moment) for bus, part in self.parts.items()}, dict
            )
        return self._taken(told, moment, grid.number)

    def _exchange(self, buses: Mapping[str, Bus], orders: Mapping[str, Any], moment: float) -> dict[str, Any]:
        """Send orders and questions on all buses from this moment on, then take what comes; see `exchange_on`."""
        found: dict[str, Any] = {}
        batches: dict[Bus, Any] = {}
        for name, bus in buses.items():
            part = self.parts[name]
            try:
                part.await_slot(bus, moment)
            except MotorbusError as error:
                found[name] = error
            else:
                batches[bus] = (*orders[name], *part.reads)
        try:
            values = exchange_on(batches, LOST)
        except MotorbusError as error:
            values = dict.fromkeys(batches, error)
        for name, bus in buses.items():
            if bus in values:
                found[name] = values[bus]
                self.parts[name].ended = self.parts[name].now
        return {name: found[name] for name in buses}

    def _orders(self, periods: int) -> dict[str, Sequence[Request[Any]]]:
        try:
            orders = {bus: part.orders(periods) for bus, part in self.parts.items()}
        except MotorbusError:  # nothing leaves, on any bus
            for place in self._all:
                place.rest()
            raise
        for part in self.parts.values():
            if part.unsure:
                for name in part.left_out:
                    self.statistics.unordered[name] += 1
        return orders

    def _judge(self, periods: int) -> None:
        """Before anything is sent: has somebody been told something, and may all goals be sent?"""
        for part in self.parts.values():
            if part.command.lost() is not None:
                self._release_lost()
        if self._fresh and (lost := [one for part in self.parts.values() for one in part.release_claimed()]):
            raise stopped(lost)
        for place in self._all:
            if place.asked is not None:
                place.judge(periods)

    async def _tell_clamps(self, now: float) -> None:
        """Count what was clamped, and tell of it where it has not been told of lately."""
        events: dict[str, list[Clamped]] = {}
        for event in self._clamps:
            self.statistics.clamped[event.axis] += 1
            if self._tidings.worth(event, now):
                events.setdefault(self.places[event.axis].axis.spec.bus, []).append(event)
        self._clamps.clear()
        if events:
            await Parallel({bus: _reported(found) for bus, found in events.items()}, settled)

    def _release_lost(self) -> None:
        lost = [name for part in self.parts.values() for name in part.release_lost()]
        if lost:
            raise stopped(lost)

    def _stand(self, periods: int) -> None:
        """Nobody was told anything for so many periods: after many, all stand at their last goals."""
        if periods > CATCH_UP:
            for place in self._all:
                place.rest()

    def _unbegun(self) -> dict[str, list[Place]]:
        """Who has a goal and no torque yet, by bus."""
        self._fresh = False
        return {
            bus: found
            for bus, part in self.parts.items()
            if (found := [one for one in part.places.values() if one.asked is not None and not one.begun])
        }

    async def _begin(self, fresh: Mapping[str, list[Place]]) -> None:
        self._fresh = True
        try:
            await Parallel({bus: self.parts[bus].begin(there) for bus, there in fresh.items()}, settled)
        except MotorbusError:
            for part in self.parts.values():
                part.release_unbegun()
            self._fresh = False
            raise
        self._fresh = False
        self.statistics.begun += 1

    def _taken(self, told: Mapping[str, Any], moment: float, number: int) -> LoopState:
        self._count(moment)
        return self._state(told, self._heard(told), number)

    def _count(self, moment: float) -> None:
        """A cycle is over that was to begin at that moment."""
        statistics, parts = self.statistics, self.parts.values()
        statistics.cycles += 1
        for bus, part in self.parts.items():
            statistics.buses[bus].add(part.ended - part.began)
        first = min([part.began for part in parts])
        last = max([part.ended for part in parts])
        statistics.lateness.add(max(0.0, first - moment))
        statistics.cycle.add(last - first)

    def _heard(self, told: Mapping[str, Any]) -> list[str]:
        """Note what a cycle brought; who was not heard. Raises what went wrong."""
        missing: list[str] = []
        failed = False
        for bus, part in self.parts.items():
            found = told[bus]
            if isinstance(found, MotorbusError):
                failed = True
            else:
                missing += part.take(found)
        if failed:
            self._fail(told)
        return missing

    def _state(self, told: Mapping[str, Any], missing: list[str], number: int) -> LoopState:
        """What is told of a cycle. Raises LimitExceeded for who is held back, NoReply for who is silent too long."""
        parts = self.parts
        last = max([part.ended for part in parts.values()])
        state = state_of(parts, told, self._all, missing, last, number, self.statistics)
        settled(refusals(parts))
        return state

    def _fail(self, told: Mapping[str, Any]) -> None:
        """A bus has raised: who was told something from elsewhere is led no more, the others there stay for now.

        Where the port is gone nobody is: an axis must not go on when the cable is in again.
        """
        found = dict(told)
        for bus, error in told.items():
            if isinstance(error, MotorbusError):
                part = self.parts[bus]
                for place in part.places.values():
                    place.rest()
                if isinstance(error, LinkLost):
                    part.release_gone()
                lost = part.release_lost() if isinstance(error, RELEASES) else []
                if lost and isinstance(error, Interrupted):
                    found[bus] = stopped(lost)
                    found[bus].__cause__ = error
        settled({**found, **refusals(self.parts)})

    # -- leaving -------------------------------------------------------------------------------------------------------

    async def leaving(self) -> None:
        """Those that follow a goal and are on their way brake, as hard as they may, and stay where that ends.

        Who was told something from elsewhere is left alone, and so is whoever can be told nothing any more. Raises what
        went wrong when all others rest.
        """
        grid, self._grid = self._grid, None
        self.refuse()
        if grid is not None:
            await braked(self.parts, grid)

    def refuse(self) -> None:
        """It takes no goals and has no cycles any more."""
        self._askable, self._left = {}, True

    def _refuse_outside(self) -> None:
        """Raise RequestError before it was entered, and when it was left."""
        if self._left or not self._entered:
            raise RequestError(
                "the loop was left" if self._left else "the loop was not entered",
                expected="goals and cycles inside its `with`",
                advice=("make another one" if self._left else "enter the loop with `with`, or `async with`")
                + "; nothing was sent",
            )


async def _reported(events: Iterable[Clamped]) -> None:
    for event in events:
        await Emit(event)
