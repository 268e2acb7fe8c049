"""The parts of a journey: the axes of one bus that are led together, and an axis that keeps time by itself.

Both go through the same steps, and both end in one of two ways: all of it has arrived, or it was told to stop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from inspect import CORO_CLOSED, getcoroutinestate
from typing import TYPE_CHECKING, Any, Final

from motorbus.core.family import Positions
from motorbus.core.steps import Emit, Procedure, Progress, Sleep, catch, gather, with_cleanup
from motorbus.core.timing import Turned
from motorbus.errors import MotorbusError, NoReply, RequestError
from motorbus.motion import capabilities as single
from motorbus.motion import limits
from motorbus.motion.command import Command
from motorbus.motion.moving.forgiving import forgiven
from motorbus.motion.moving.lagging import does_not_begin
from motorbus.motion.moving.moved import STILL, Arrived, Track
from motorbus.motion.moving.plan import Fact, Gone, Planned
from motorbus.motion.moving.stream import SETTLE, SHOWN, TOLERANCE, Stream, Streamed, grains, rate_for
from motorbus.motion.reckoning import Movement, cut_short
from motorbus.motion.safety import restarts
from motorbus.motion.safety.watch import Watch
from motorbus.motion.several import named, names

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs
    from motorbus.motion.meeting import Seat
    from motorbus.motion.moving.journey import Journey

LOOK: Final = 0.02
"""s between two looks at whether the others have failed, while an axis moves by its own profile."""
DRAWN: Final = 0.02
"""s between two points of the track of such an axis."""
MOVED: Final = 0.01
"""rad of the device; less may be a limp arm that gives way, or the trembling of a reading."""
TRIES: Final = 3
"""How often all are asked where they are before one that has said nothing is taken for silent."""
NO_WAY: Final = 1e-9
"""rad or m; an axis that has less to go stays where it is."""
STEPS: Final = 2
"""How many of its smallest steps an axis has to go at least for its beginning and its end to count."""
NEAR: Final = 3
"""Its smallest steps; so near to its goal no axis need come."""


async def part(journey: Journey, party: str, axes: Sequence[AxisVerbs]) -> Gone:
    """One part of a journey, from the first look to the arrival. Whatever ends it early, its axes are told to stop."""
    led = "stream" in axes[0].able
    work: LedPart | OwnPart = LedPart(journey, party, axes) if led else OwnPart(journey, party, axes[0])
    journey.commands.append(work.command)
    await with_cleanup(_failing(journey, axes, work.run()), lambda: _ended(journey, work))
    assert work.gone is not None
    return work.gone


async def _failing(journey: Journey, axes: Sequence[AxisVerbs], work: Procedure[None]) -> None:
    """Let the other parts know when this one fails; whose device it was is told by the name of the axis."""
    try:
        await work
    except MotorbusError as error:
        told = _told(journey, axes, error)
        journey.fail(told)
        if told is error:
            raise
        raise told from error
    except BaseException as error:
        journey.fail(error)
        raise


def _told(journey: Journey, axes: Sequence[AxisVerbs], error: MotorbusError) -> MotorbusError:
    """The same error, which names the axis that it befell, unless it names one of the movement already."""
    failure = journey.fate.failure
    if failure is not None and failure.__cause__ is error:  # told already; what was noted since belongs to it
        failure.__notes__ = list(getattr(error, "__notes__", ()))
        return failure
    if failure is not None:
        return error
    if any(names(error, name) for name in journey.names):
        return error
    whose = [axis.name for axis in axes if len(axes) == 1 or axis.spec.node == error.node]
    return named(whose[0], error) if whose else error


async def _ended(journey: Journey, work: LedPart | OwnPart) -> None:
    """Stop what was begun and has not arrived."""
    if work.begun and work.gone is None:
        journey.unstopped.update(await work.stop())


class LedPart:
    """The axes of one bus, led along the course."""

    def __init__(self, journey: Journey, party: str, axes: Sequence[AxisVerbs]) -> None:
        self.command: Final = Command(axes)
        self.watch: Final = Watch(axes[0].bus, axes)
        self.begun = False
        self.gone: Gone | None = None
        self._journey: Final = journey
        self._party: Final = party
        self._axes: Final = axes
        self._bus: Final = axes[0].bus

    async def stop(self) -> dict[str, MotorbusError]:
        """See `Command.stop`."""
        return await self.command.stop()

    async def run(self) -> None:
        """See `part`."""
        journey, axes = self._journey, self._axes
        train = await self._train()
        rate, looked = await self._looked(train)
        facts = await journey.meet(self._party, looked)
        seat = journey.seat(self._party, axes[0].spec.bus)
        shortest = journey.outlined(facts).course.duration
        planned = journey.agreed(facts, await seat.agreed(shortest, _any))
        stream = Stream(
            axes,
            train,
            planned.course,
            rate=rate,
            speeds=planned.speeds,
            within={axis.name: self._within(axis, facts[axis.name], planned) for axis in axes},
            command=self.command,
            watch=self.watch,
            fate=journey.fate,
            patience=SETTLE if journey.timeout is None else journey.timeout,
            reports=journey.reports(self._party),
        )
        await self._ready(train, facts)
        lead = stream.lead(self._bus)
        streamed = await stream.run(await seat.start(lead, lambda: self._again(train)), lead)
        for axis in axes:
            axis.arrives()
        arrived = {axis.name: _seen(axis, facts[axis.name], planned, streamed) for axis in axes}
        self.gone = Gone(arrived, streamed.tracks, streamed.cycles)

    async def _again(self, train: Any) -> None:
        """Ask where they are: others may have needed long, and no goal leaves by what was so a while ago."""
        await gather(*[catch(one) for one in train.positions])

    async def _train(self) -> Any:
        """Those who are led, with all known of them that a cycle needs."""
        axes = self._axes
        try:
            return await axes[0].able.stream([axis.device for axis in axes], rate=self._bus.rate)
        except NoReply as error:
            silent = [axis for axis in axes if axis.spec.node == error.node]
            if not silent:
                raise
            raise does_not_begin(silent[0]) from error

    async def _looked(self, train: Any) -> tuple[float, dict[str, Fact]]:
        """At which rate they can be led (Hz), where they stand, and how far and how finely their devices go."""
        angles = await self._angles(train)
        found = await gather(*[limits.of_device(axis) for axis in self._axes])
        devices = {axis.spec.node: device for axis, device in zip(self._axes, found, strict=True)}
        possible = {node: _inside(angles[node], device) for node, device in devices.items()}
        steps = grains(train, possible)
        rate = rate_for(self._bus, train, possible, self._journey.rate)
        facts = {
            axis.name: Fact(axis.spec.from_device(angles[node]), devices[node], steps[node], rate)
            for node, axis in ((axis.spec.node, axis) for axis in self._axes)
        }
        return rate, facts

    async def _angles(self, train: Any) -> dict[int, float]:
        """Where each stands (rad of the device), by id. Raises NoReply for one that is silent."""
        angles: dict[int, float] = {}
        for _ in range(TRIES):
            for one in await forgiven(train.positions):
                angles.update(one.values if isinstance(one, Positions) else {})
            missing = [axis for axis in self._axes if axis.spec.node not in angles]
            if not missing:
                return angles
        raise does_not_begin(missing[0])

    async def _ready(self, train: Any, facts: Mapping[str, Fact]) -> None:
        """Torque on where they stand, and as quick in following as the axis may be."""
        angles = await self._angles(train)
        for axis in self._axes:
            _check_still(axis, facts[axis.name].position, axis.spec.from_device(angles[axis.spec.node]))
            await restarts.unbroken(axis)
        self.command.depart()
        self.begun = True
        try:
            await self.command.watched(self._begin(train))
        except MotorbusError as error:
            if (lost := self.command.lost()) is not None:  # what was let go meanwhile tells that in many ways
                raise lost from error
            raise
        await self.watch.begin(self._axes)

    def _within(self, axis: AxisVerbs, fact: Fact, planned: Planned) -> float:
        """How near to its goal it must come (rad of the device)."""
        asked = self._journey.tolerance
        return _within(axis, fact, planned) if asked is None else asked * abs(axis.spec.ratio)

    async def _begin(self, train: Any) -> None:
        for axis in self._axes:
            await single.cap(axis)
        speeds = {axis.spec.node: axis.spec.rate_to_device(axis.spec.max_velocity) for axis in self._axes}
        await train.start({node: abs(speed) for node, speed in speeds.items()})


class OwnPart:
    """An axis that moves by a profile of its own, from where it is reckoned to be."""

    def __init__(self, journey: Journey, party: str, axis: AxisVerbs) -> None:
        self.command: Final = Command([axis])
        self.gone: Gone | None = None
        self._journey: Final = journey
        self._axis: Final = axis
        self._timing: Final = Kept(journey, party, axis)

    @property
    def begun(self) -> bool:
        """Whether it may have been told to move."""
        return self._timing.moment is not None

    async def stop(self) -> dict[str, MotorbusError]:
        """See `Command.stop`. Its driver has stopped it already, and tells nobody whether that was accepted."""
        return await self.command.stop(anew=self._axis.under_way)

    async def run(self) -> None:
        """See `part`."""
        axis, timing = self._axis, self._timing
        axis.refuse_under_way()
        assert axis.reckoning is not None
        stood = axis.reckoning.known(axis.name)
        await timing.meet(stood)
        way = timing.planned.goals[axis.name] - stood
        if abs(way) <= NO_WAY:
            await timing.agreed(0.0, _any)
            await timing.start(0.0)
            self.gone = self._stayed(stood)
            return
        turned = self._turned(way)
        told = await gather(turned, self._watched(turned))
        assert told[0] is not None
        self.gone = self._arrived(stood, told[0])

    async def _turned(self, way: float) -> Turned:
        axis, spec, movement = self._axis, self._axis.spec, Movement()
        try:
            self.command.depart(movement)
            turned: Turned = await axis.able.keep_time(
                axis.device,
                way * spec.ratio,
                self._timing,
                velocity=abs(spec.rate_to_device(self._timing.planned.limits[axis.name].velocity)),
                acceleration=abs(spec.rate_to_device(self._timing.planned.limits[axis.name].acceleration)),
            )
            axis.arrives(movement, movement.after(turned.angle / spec.ratio))
        except BaseException as error:
            if self.begun:
                cut_short(axis, movement, error)
            else:
                axis.stays(movement)
            raise
        return turned

    async def _watched(self, turned: Procedure[Turned]) -> None:
        """While it is under way: stop it when another part fails, and tell how far all of it is."""
        journey, timing = self._journey, self._timing
        reported = -SHOWN
        while getcoroutinestate(turned) != CORO_CLOSED:  # however that came to its end
            now = await Sleep(LOOK)
            if timing.moment is None:
                continue
            if (lost := self._overtaken()) is not None:
                journey.fail(lost)
            if journey.fate.failure is not None:
                journey.unstopped.update(await self.command.stop())
                return
            since = now - timing.moment
            if journey.reports(timing.party) and reported + SHOWN <= since <= timing.duration:
                reported = since
                await Emit(Progress(round(1000 * since), round(1000 * timing.duration), "moving"))

    def _overtaken(self) -> MotorbusError | None:
        """The error when somebody else has stopped it. Its driver looks for that more seldom, and stops it itself."""
        ordered = not self.command.untold() or self._axis.bus.latched
        return self.command.lost() if ordered else None

    def _stayed(self, stood: float) -> Gone:
        arrived = Arrived(self._timing.planned.goals[self._axis.name], stood, True, 0.0, 0.0, stood)
        return Gone({self._axis.name: arrived}, {self._axis.name: Track(estimated=True)})

    def _arrived(self, stood: float, turned: Turned) -> Gone:
        axis, timing = self._axis, self._timing
        assert timing.moment is not None
        began = turned.start - timing.moment
        ended = began + turned.duration
        present = stood + turned.angle / axis.spec.ratio
        arrived = Arrived(timing.planned.goals[axis.name], present, True, began, ended, stood)
        count = int(max(ended, timing.duration) / DRAWN) + 1
        times = (*(number * DRAWN for number in range(count)), max(ended, timing.duration))
        goals = tuple(timing.planned.course.positions(at)[axis.name] for at in times)
        ways = (turned.way(at - began) / axis.spec.ratio for at in times)
        track = Track(times, goals, tuple(stood + way for way in ways), estimated=True)
        return Gone({axis.name: arrived}, {axis.name: track})


class Kept:
    """How such an axis keeps time with the rest of its journey: a `core.timing.Timing` that remembers what it said."""

    planned: Planned

    def __init__(self, journey: Journey, party: str, axis: AxisVerbs) -> None:
        self.party: Final = party
        self.duration = 0.0
        self.moment: float | None = None
        self._journey: Final = journey
        self._axis: Final = axis
        self._seat: Final[Seat] = journey.seat(party, axis.spec.bus)
        self._facts: Mapping[str, Fact] = {}

    async def meet(self, position: float) -> None:
        """Say where it stands (rad, m), and get to know what the movement shall be."""
        self._facts = await self._journey.meet(self.party, {self._axis.name: Fact(position)})
        self.planned = self._journey.outlined(self._facts)

    async def agreed(self, shortest: float, fitted: Callable[[float], float]) -> float:
        """See `core.timing.Timing`."""
        self._journey.check_asked(self._axis.name, shortest)
        least = max(shortest, self.planned.course.duration)
        self.duration = await self._seat.agreed(least, lambda others: max(others, fitted(others)))
        self._journey.needs[self._axis.name] = max(shortest, fitted(least))
        self.planned = self._journey.agreed(self._facts, self.duration)
        return self.duration

    async def start(self, lead: float) -> float:
        """See `core.timing.Timing`."""
        moment = await self._seat.start(lead)
        self._journey.check()  # all were ready, and one of them may have been stopped since
        self.moment = moment
        return moment

    def fails(self, error: BaseException) -> None:
        """See `core.timing.Timing`."""
        told = _told(self._journey, [self._axis], error) if isinstance(error, MotorbusError) else error
        self._journey.fail(told)


def _any(duration: float) -> float:
    """Whoever can have every duration."""
    return duration


def _check_still(axis: AxisVerbs, stood: float, stands: float) -> None:
    """Raise RequestError for an axis that is not where it was (rad, m) when the movement was planned."""
    if abs(stands - stood) * abs(axis.spec.ratio) > MOVED:
        raise RequestError(
            f"{axis.name} is moving: it was at {axis.spec.show(stood)}, and is at {axis.spec.show(stands)}",
            expected="an axis at rest, for a movement begins from rest",
            cause="another movement leads it, or it is moved by hand",
            advice="wait until it rests, or stop it first; nobody was moved, others of the movement may have torque",
            node=axis.spec.node,
        )


def _inside(angle: float, device: limits.Device) -> float:
    """An angle (rad) that its device can be told, this one if that may be."""
    return angle if device is None else min(max(angle, device[0]), device[1])


def _seen(axis: AxisVerbs, fact: Fact, planned: Planned, streamed: Streamed) -> Arrived:
    """What the host saw of an axis that was led."""
    track, still = streamed.tracks[axis.name], STILL / abs(axis.spec.ratio)
    present = track.presents[-1] if track.presents else fact.position
    went = _goes(axis, fact, planned)
    began, ended = (streamed.started, track.rested(still)) if went else (0.0, 0.0)
    return Arrived(planned.goals[axis.name], present, False, began, ended, fact.position)


def _goes(axis: AxisVerbs, fact: Fact, planned: Planned) -> bool:
    """Whether it goes so far that its first step and its last can be told apart."""
    return planned.ways[axis.name] * abs(axis.spec.ratio) >= STEPS * fact.grain


def _within(axis: AxisVerbs, fact: Fact, planned: Planned) -> float:
    """How near to its goal it must come (rad of the device): on a tiny way so near that it has moved.

    Who has no way to go stands as it stands: under its load it gives way a little when it gets torque.
    """
    if not _goes(axis, fact, planned):
        return TOLERANCE
    return min(TOLERANCE, max(NEAR * fact.grain, planned.ways[axis.name] * abs(axis.spec.ratio) / 2))
