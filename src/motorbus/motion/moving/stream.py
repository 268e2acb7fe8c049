"""The axes of one bus on their way along a course: small goals on a fixed grid, and positions back in each cycle.

A goal that leaves at one slot of the grid is where the axis shall be at the next one. So the first order sets it moving
at once, and the last one leaves just early enough. A servo goes from goal to goal at its own speed; the goals come so
often that it never comes to rest between two of them. A slot that was missed is skipped and counted, the grid is never
stretched: where the axis is at a moment does not depend on how busy the host was before.

What goes wrong is seen within a few cycles: an axis that does not follow, one that is silent, an order from elsewhere,
another bus of the same movement that has failed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, floor, inf
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.bus.base import BaseBus
from motorbus.core.family import Positions, PositionStream
from motorbus.core.steps import Emit, Procedure, Progress, Sleep, gather
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, Refused, RequestError
from motorbus.motion import limits
from motorbus.motion.command import Command
from motorbus.motion.moving.forgiving import forgiven
from motorbus.motion.moving.gaps import Gaps
from motorbus.motion.moving.lagging import FAR, allowed, behind, held_up, not_there, silent
from motorbus.motion.moving.moved import STILL, Cycles, Track
from motorbus.motion.profile.shapes import NOTHING
from motorbus.motion.safety.watch import Watch
from motorbus.motion.trajectory import Course

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

USUAL: Final = 100.0
"""Hz at which axes are led where the wire carries twice as much."""
SHARE: Final = 0.5
"""Of what the wire carries: the rest is for others, and for a reply that has to be asked for again."""
TOLERANCE: Final = 0.02
"""rad of the device, a little more than a degree: under load a servo stays off its goal."""
SETTLE: Final = 1.0
"""s after the end of the course within which an axis must be in position."""
HELD_UP: Final = 0.5
"""s between two goals after which nobody is led on: the next one would be far ahead of where the axes stopped."""
FINEST: Final = 1e-5
"""rad of the device; no servo can be told less."""
SILENCE: Final = 0.3
"""s for which an axis may not answer, or five cycles, if those last longer: a bus that doubts a device leaves it alone
for a while, and asks it twice more in this time."""
SHOWN: Final = 0.25
"""s between two reports of progress."""


class Fate:
    """What the parts of one movement know of each other: whether one of them has failed, and why."""

    def __init__(self) -> None:
        self.failure: MotorbusError | None = None

    def fail(self, error: MotorbusError) -> None:
        """A part has failed; the others learn it in their next cycle."""
        self.failure = self.failure or error

    def check(self) -> None:
        """Raise Interrupted when another part has failed."""
        if self.failure is not None:
            raise Interrupted(
                "the movement was ended, for another part of it failed",
                cause=self.failure.summary,
                advice="all its axes were told to stop",
            )


class Streamed(NamedTuple):
    """What came of it: a track for each axis by its name, how the cycles went, when (s) the first order was gone."""

    tracks: dict[str, Track]
    cycles: Cycles
    started: float = 0.0


class Grid(NamedTuple):
    """The slots of a course: a goal leaves every `period` s; `last` is the number of the last one, the first is 0."""

    period: float
    last: int

    @classmethod
    def over(cls, duration: float, rate: float) -> Grid:
        """At most `rate` (Hz) slots, so that the last goal leaves one period before the end of the course."""
        slots = max(1, floor(duration * rate * (1 + 1e-9)))
        return cls(duration / slots if duration else 1 / rate, slots - 1)

    def after(self, slot: int, since: float) -> int:
        """The slot that comes next when this one is done so many s after the start; never beyond the last."""
        return min(max(slot + 1, ceil(since / self.period - 1e-6)), self.last)


def rate_for(
    bus: BaseBus, train: PositionStream, angles: Mapping[int, float], asked: float | None = None
) -> float:
    """Hz at which the axes of a train are led; where nobody has asked for one see `USUAL` and `SHARE`.

    `angles` are goals that they could be told, by id (rad): for counting, each is as long as any other. Raises
    RequestError for a rate that is none, or more than the wire carries.
    """
    cycle = (*train.goals(angles), *train.positions)
    highest = 1 / sum(bus.driver.air_time(one, bus.rate) for one in cycle)
    if asked is None:
        asked = min(USUAL, max(SHARE * highest, limits.SLOWEST))
    if not limits.SLOWEST <= asked <= highest:
        raise RequestError(
            f"{asked:.6g} Hz is not possible here",
            expected=f"{limits.SLOWEST:g} Hz or more, so a host that dies leaves no more; {highest:.4g} Hz at most",
            cause=f"{bus.rate} bit/s carry no more cycles of {len(train.nodes)} of these",
            advice=f"take another, or a quicker line; {NOTHING}",
        )
    return asked


def grains(train: PositionStream, angles: Mapping[int, float]) -> dict[int, float]:
    """By id, the smallest step (rad) that each can be told from its angle (rad): goals say what will be told."""
    return {node: _grain(train, node, angle) for node, angle in angles.items()}


def _grain(train: PositionStream, node: int, angle: float) -> float:
    here = _told(train, node, angle)
    step = FINEST
    while step < FAR:
        for there in (_told(train, node, angle + step), _told(train, node, angle - step)):
            if here is not None and there not in (None, here):
                return abs(there - here)
        step *= 2
    return FAR


def _told(train: PositionStream, node: int, angle: float) -> float | None:
    """What it is told for an angle (rad); None for one that it cannot be told."""
    try:
        (request,) = train.goals({node: angle})
    except LimitExceeded:
        return None
    return next((goal.value for goal in request.setpoints), None)


class Stream:
    """Axes of one bus that are led along a course; `speeds` are the highest of it by name (rad/s, m/s).

    `within` is by name how near to its goal each must come in the end (rad of the device).
    `command` is over these axes, `watch` over how they fare, `fate` is that of the whole movement. `patience` is how
    long (s) after the end all must be in position. With `reports` it reports its progress.
    """

    def __init__(
        self,
        axes: Sequence[AxisVerbs],
        train: PositionStream,
        course: Course,
        *,
        rate: float,
        speeds: Mapping[str, float],
        within: Mapping[str, float],
        command: Command,
        watch: Watch,
        fate: Fate,
        patience: float = SETTLE,
        reports: bool = False,
    ) -> None:
        self._axes: Final = {axis.spec.node: axis for axis in axes}
        self._train: Final = train
        self._course: Final = course
        self._grid: Final = Grid.over(course.duration, rate)
        self._allowed: Final = {axis.name: allowed(axis, speeds[axis.name]) for axis in axes}
        self._within: Final = within
        self._command: Final = command
        self._watch: Final = watch
        self._fate: Final = fate
        self._patience: Final = patience
        self._reports: Final = reports
        self._tracks: dict[str, tuple[list[float], list[float], list[float]]] = {
            axis.name: ([], [], []) for axis in axes
        }
        self._start = self._lead = self._first = self._reported = 0.0
        self._gaps: Final = Gaps(self._grid.period)
        self._over = False
        self._silent: dict[int, float] = {}
        self._places: dict[int, float] = {}
        self._cycles = self._skipped = self._lost = 0

    def lead(self, bus: BaseBus) -> float:
        """s before the start at which the first goals must leave, so that they have arrived then."""
        return sum(bus.driver.air_time(one, bus.rate) for one in self._train.goals(self._goals(0.0)))

    async def run(self, start: float, lead: float = 0.0) -> Streamed:
        """Lead them along the course, which begins at `start` (s on the link's clock), and see them arrive.

        Goals leave `lead` s before their slot. Raises Stalled for an axis that does not follow or arrive, NoReply for
        one that is silent, Interrupted when somebody else has told one of them something, another part has failed or
        the host was held up, and what the watch over them raises: Faulted, Overloaded.
        """
        self._start = start
        self._lead = lead
        await gather(self._ending(self._tell()), self._ending(self._look()))
        await self._settle()
        tracks = {name: _track(*rows) for name, rows in self._tracks.items()}
        cycles = Cycles(1 / self._grid.period, self._cycles, self._skipped, self._lost)
        return Streamed(tracks, cycles, self._first)

    async def _ending(self, work: Procedure[None]) -> None:
        """When one of the two ends, however that comes, the other one ends too."""
        try:
            await work
        finally:
            self._over = True

    async def _tell(self) -> None:
        """A goal at each slot of the grid, whatever becomes of the readings."""
        slot = 0
        while not self._over:
            await self._until(slot)
            if self._over:
                return  # an axis does not follow, or nobody hears it
            self._fate.check()
            last = slot == self._grid.last
            at = self._course.duration if last else (slot + 1) * self._grid.period
            await self._order(at)
            if slot == 0:
                self._first = await Sleep(0) - self._start
            self._cycles += 1
            if last:
                return
            reached = await self._next(slot)
            self._skipped += reached - slot - 1
            if (gap := (reached - slot) * self._grid.period) > HELD_UP:
                raise held_up(gap)
            slot = reached

    async def _look(self) -> None:
        """A reading at each slot, behind the goal. One that has to wait for a doubtful device makes no goal late."""
        slot = 0
        while not self._over:
            await self._until(slot)
            await self._read()
            for axis in self._axes.values():
                if self._is_behind(axis):
                    raise await self._stalled(axis)
            await self._ask()
            await self._report(slot * self._grid.period)
            slot = await self._next(slot)

    async def _until(self, slot: int) -> None:
        """Wait for a slot. Nobody may wait between this and what is sent, or others go first."""
        due = self._start - self._lead + slot * self._grid.period
        await Sleep(max(0.0, due - await Sleep(0)))

    async def _next(self, slot: int) -> int:
        return self._grid.after(slot, await Sleep(0) + self._lead - self._start)

    async def _order(self, at: float) -> None:
        try:
            await forgiven([self._command.guarded(one) for one in self._train.goals(self._goals(at))])
        except Refused as error:
            if error.reason in ("step", "velocity") and error.node in self._axes:
                raise await self._stalled(self._axes[error.node]) from error
            if error.reason == "stale" and (gap := self._gaps.lately(await Sleep(0))):
                raise held_up(gap) from error
            raise
        except Interrupted:
            if self._watch.fault is None:  # else who looks is about to raise that
                raise
        else:
            self._gaps.left(await Sleep(0))

    def _goals(self, at: float) -> dict[int, float]:
        """The goals (rad of the device) for a moment of the course, by id."""
        places = self._course.positions(at)
        return {node: axis.spec.to_device(places[axis.name]) for node, axis in self._axes.items()}

    async def _read(self) -> None:
        """Read the positions, and keep what was heard."""
        told = await forgiven(self._train.positions)
        heard = {node for one in told if isinstance(one, Positions) for node in self._keep(one)}
        now = await Sleep(0)
        for node in self._axes.keys() - heard:
            self._lost += 1
            self._check_silent(node, now)

    async def _ask(self) -> None:
        """How one of them fares, when it is his turn and there is room before the next slot."""
        now = await Sleep(0)
        since = now - self._start
        slack = self._grid.period - (since + self._lead) % self._grid.period
        goals = self._goals(min(since, self._course.duration))
        await self._watch.asking(slack, goals, self._places)

    def _keep(self, found: Positions) -> set[int]:
        since = found.at - self._start
        should = self._course.positions(since)
        for node, angle in found.values.items():
            axis = self._axes[node]
            for row, value in zip(
                self._tracks[axis.name],
                (since, should[axis.name], axis.spec.from_device(angle)),
                strict=True,
            ):
                row.append(value)
            self._silent.pop(node, None)
        self._places.update(found.values)
        return set(found.values)

    async def _report(self, since: float) -> None:
        if self._reports and since >= self._reported:
            self._reported = since + SHOWN
            done, total = round(1000 * since), round(1000 * self._course.duration)
            await Emit(Progress(done, total, "moving"))

    # -- the end of it -------------------------------------------------------------------------------------------------

    async def _settle(self) -> None:
        """Read positions until all are where they should be, and have come to rest."""
        period = max(self._grid.period, 0.005)
        end = self._start + self._course.duration
        await Sleep(max(0.0, end - await Sleep(0)))
        exact = False
        while True:
            await self._read()
            now = await Sleep(0)
            exact = exact or all(self._off(axis) <= STILL for axis in self._axes.values())
            if exact and all(self._arrived(axis, now - end) for axis in self._axes.values()):
                break
            if now - end > self._patience:
                await self._check_arrived()
            await self._ask()
            self._fate.check()
            self._command.check()
            if not exact:
                await self._order(self._course.duration)  # the last goal may have been lost on the wire
                exact = True
            await Sleep(period)
        if self._reports:
            total = round(1000 * self._course.duration)
            await Emit(Progress(total, total, "moving"))

    def _arrived(self, axis: AxisVerbs, since: float) -> bool:
        """Whether it was seen in position after the end, twice at the same place; when time is up, once."""
        *_, presents = self._tracks[axis.name]
        times = self._tracks[axis.name][0]
        if not times or times[-1] < self._course.duration or self._off(axis) > self._within[axis.name]:
            return False
        before = presents[-2] if len(presents) > 1 else presents[-1]
        still = abs(presents[-1] - before) * abs(axis.spec.ratio) <= STILL
        return still or since > self._patience

    def _off(self, axis: AxisVerbs) -> float:
        """How far it was last seen from its goal, in rad of the device."""
        *_, presents = self._tracks[axis.name]
        goal = self._course.positions(self._course.duration)[axis.name]
        return abs(presents[-1] - goal) * abs(axis.spec.ratio) if presents else inf

    # -- what must not be ----------------------------------------------------------------------------------------------

    def _is_behind(self, axis: AxisVerbs) -> bool:
        _, goals, presents = self._tracks[axis.name]
        return bool(goals) and abs(goals[-1] - presents[-1]) > self._allowed[axis.name]

    async def _stalled(self, axis: AxisVerbs) -> MotorbusError:
        """The error for one that does not follow; raises what is the matter with it, if it tells that."""
        gap = self._gaps.lately(await Sleep(0))
        await self._watch.examine(axis)
        if gap:
            return held_up(gap)
        goal, present = (row[-1] for row in self._tracks[axis.name][1:])
        return behind(axis, goal, present, self._allowed[axis.name], self._watch.alarms(axis))

    async def _check_arrived(self) -> None:
        """Raise Stalled for those that are not in position, or what is the matter with one of them."""
        short = [axis for axis in self._axes.values() if self._off(axis) > self._within[axis.name]]
        for axis in short:
            await self._watch.examine(axis)
        if short:
            near = self._within[short[0].name] / abs(short[0].spec.ratio)
            presents = {name: rows[2] for name, rows in self._tracks.items()}
            goals = self._course.positions(self._course.duration)
            alarms = {axis.name: self._watch.alarms(axis) for axis in short}
            raise not_there(short, goals, presents, near, self._patience, alarms)

    def _check_silent(self, node: int, now: float) -> None:
        """Raise NoReply for an axis that has not answered for too long; nobody asks while the host is held up."""
        since = self._silent.setdefault(node, now)
        if now - since > max(SILENCE, 5 * self._grid.period):
            raise silent(self._axes[node], now - since)


def _track(times: Sequence[float], goals: Sequence[float], presents: Sequence[float]) -> Track:
    return Track(tuple(times), tuple(goals), tuple(presents))
