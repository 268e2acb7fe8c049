"""The control loop: goals out and positions in on all buses, in the slots of one clock. The only cyclic engine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from typing import Any, Final, Literal, TypeAlias

from msgspec import Struct

from motorbus.bus.base import BaseBus
from motorbus.core.family import Positions, PositionStream
from motorbus.core.request import Precondition, Request, SetpointGroup, SetpointWrite, Stops
from motorbus.core.steps import Guard, Sleep, catch, discard, gather
from motorbus.core.stream import read_positions
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, NoReply, Refused, RequestError
from motorbus.motion.axis import FRESH, Axis, by_bus, name_axis, on_axes
from motorbus.motion.gate import check_owned, lease_lost
from motorbus.motion.health import HealthMonitor
from motorbus.motion.machine import SLACK, Names
from motorbus.motion.profile import Limits, SetpointGenerator
from motorbus.motion.program import LOST, Exchange, OnBuses, raise_first
from motorbus.motion.state import OpenMachine

Policy: TypeAlias = Literal["reject", "clamp"]
MAX_MISSED: Final = 2  # cycles without a position after which an axis gets no goal
SILENCE: Final = 0.3  # s without a position after which the loop ends
STALE: Final = 0.8 * FRESH  # s; an older position is read again before goals are sent
STALL: Final = 0.5  # s that the host may be late
CATCH_UP: Final = 3  # periods that a late cycle makes good by one longer step
MIN_RATE: Final = 4.0  # Hz; goals are one period ahead
MAX_RATE: Final = 1000.0  # Hz
USUAL_RATE: Final = 100.0  # Hz
LEAD: Final = 0.002  # s from the end of `wait` to the slot
WIRE_SHARE: Final = 0.7  # of what the wire carries, for a rate that is chosen here
ENTRY_TRIES: Final = 5  # reads in which each axis must answer once


class LoopStatistics(Struct):
    """`overruns`: cycles that began late; `skipped`: slots without a cycle; the rest by name of the axis.

    `lost` counts readings that are missing or doubtful, `clamped` targets.
    """

    rate: float
    cycles: int = 0
    overruns: int = 0
    skipped: int = 0
    lost: dict[str, int] = {}
    clamped: dict[str, int] = {}


@dataclass(frozen=True, slots=True)
class LoopState:
    """One cycle: its slot, its end (s), the last positions (rad, m), the axes that did not answer."""

    number: int
    at: float
    position: Mapping[str, float]
    missing: frozenset[str] = frozenset()


class LoopAxis:
    """An axis in a loop. `owner` is its number while it has torque from this loop, else None.

    The target, and what was `sent` last, are positions (rad, m), of a wheel velocities (rad/s).
    """

    __slots__ = (
        "axis", "behind", "claimed", "config", "generator", "high", "low", "missed", "name", "owner", "position",
        "sent", "silent_since", "status", "target",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        config = axis.config
        self.axis: Final = axis
        self.config: Final = config
        self.status: Final = axis.status
        self.name: Final = axis.name
        self.low, self.high = (
            (-config.max_velocity, float(config.max_velocity)) if config.is_wheel else axis.range
        )
        self.generator = SetpointGenerator(0.0, Limits(config.max_velocity, config.acceleration))
        self.target: float | None = None
        self.owner: int | None = None
        self.claimed = 0
        self.position = self.sent = 0.0
        self.missed = 0
        self.silent_since = 0.0
        self.behind = False  # of the targets of a direct loop, after a silence

    def allows(self, target: float) -> bool:
        """Whether a target is inside the limits, or leads back towards them; never NaN."""
        low, high, here = self.low, self.high, self.position
        return low - SLACK <= target <= high + SLACK or here <= target <= low or high <= target <= here

    def release(self) -> None:
        """It gets no goals until its next target."""
        self.target = self.owner = None

    def show(self, value: float) -> str:
        """A target with its unit."""
        return f"{value:.4g} rad/s" if self.config.is_wheel else self.config.show(value)

    def restart(self) -> None:
        """Go on from the measured position, at rest."""
        if not self.config.is_wheel:
            self.sent = self.position
            self.generator.reset(self.position)


@dataclass(slots=True, eq=False)
class BusGroup:
    """The axes of one bus in a loop. `reads` bring their positions; `group` is the last group of goal requests."""

    bus: BaseBus
    axes: dict[int, LoopAxis]
    stream: PositionStream | None
    reads: tuple[Request[Positions], ...]
    group: tuple[SetpointGroup, SetpointGroup] | None = field(default=None)

    def goals(self, goals: Mapping[int, float]) -> Sequence[Request[Any]]:
        """Requests of these goals (rad of the device), which leave only while the loop owns the axes."""
        if not goals or self.stream is None:
            return ()
        return [self._owned(request) for request in self.stream.goals(goals)]

    def _owned(self, request: Request[Any]) -> Request[Any]:
        if not isinstance(request, SetpointWrite):
            return replace(request, precondition=self._check(request.precondition))
        group = request.group
        if self.group is None or self.group[0] is not group:
            owned = SetpointGroup(group.nodes, group.to_setpoints, self._check(group.precondition))
            self.group = group, owned
        return request.with_group(self.group[1])

    def _check(self, own: Precondition | None) -> Precondition:
        def check(stops: Stops) -> MotorbusError | None:
            if own is not None and (error := own(stops)) is not None:
                return error
            return self.lost(None)

        return check

    def lost(self, lease: Any) -> MotorbusError | None:
        """The error if the loop does not own one of its axes any more."""
        return check_owned(
            [(one.status, one.owner) for one in self.axes.values() if one.owner is not None],
            lease,
            latched=self.bus.latched,
        )


class ControlLoop(Guard):
    """For `async with`: it brakes at the end; after an error it is closed at once.

    Targets are followed within the limits of each axis; with `direct` they are sent as they are.

    Entering reads and writes nothing. An axis gets torque, without a jump, in the cycle after its first target. A
    target outside the limits raises LimitExceeded, or is clamped and counted with the policy "clamp". A loop raises
    Interrupted after a stop, NoReply for an axis that is silent for 0.3 s, Faulted, Overloaded, Refused for a lost
    lease. `rate` in Hz; None: 100, or what the slowest bus carries.
    """

    def __init__(
        self,
        machine: OpenMachine,
        names: Names = None,
        *,
        rate: float | None = None,
        policy: Policy = "reject",
        direct: bool = False,
    ) -> None:
        chosen = machine.chosen(names)
        able = [axis for axis in chosen if axis.follows_setpoints]
        if (names is not None and len(able) < len(chosen)) or not able:
            others = ", ".join(axis.name for axis in chosen if axis not in able) or "the machine"
            raise RequestError(
                f"{others}: no setpoints can be followed", advice="robot.move() uses its own profile"
            )
        if rate is not None and not MIN_RATE <= rate <= MAX_RATE:
            raise RequestError(f"a loop of {rate} Hz", expected=f"{MIN_RATE:g} to {MAX_RATE:g} Hz")
        if policy not in ("reject", "clamp"):
            raise RequestError(f"policy {policy!r}", expected="reject or clamp")
        self.machine: Final = machine
        self.members: Final = able
        self.names: Final = tuple(axis.name for axis in able)
        self.policy: Final = policy
        self.direct: Final = direct
        self.axes: dict[str, LoopAxis] = {}
        self.groups: list[BusGroup] = []
        self.once: dict[BaseBus, list[Request[Any]]] = {}
        """Requests that leave at the beginning of the next slot, as the start of a self-timed move."""
        self.rate = rate or 0.0
        self.statistics = LoopStatistics(self.rate)
        self.slot = -1
        self._next = 0.0

    # -- targets ---------------------------------------------------------------------------------------------------

    def set_target(self, name: str, target: float) -> None:
        """The target of an axis from the next cycle on: rad or m, of a wheel rad/s."""
        axis = self.axes.get(name)
        if axis is None:
            raise RequestError(f"{name!r} is not in this loop", expected=f"one of {', '.join(self.names)}")
        if not axis.allows(target):
            if self.policy == "reject" or target != target:
                raise LimitExceeded(
                    f"{name}: {axis.show(target) if isfinite(target) else target} is outside {axis.show(axis.low)} "
                    f"to {axis.show(axis.high)}",
                    node=axis.config.node,
                )
            self.statistics.clamped[name] = self.statistics.clamped.get(name, 0) + 1
            target = min(max(target, axis.low), axis.high)
        if axis.target is None:
            axis.claimed = axis.status.owner  # a stop before the torque-on withdraws the target
        axis.target = target
        self.machine.targets[name] = target

    # -- programs --------------------------------------------------------------------------------------------------

    async def enter(self) -> None:
        """Open the streams, settle the rate, read all positions."""
        groups = by_bus(self.members)
        opened = await OnBuses({bus: _open(bus, axes) for bus, axes in groups.items()})
        raise_first(opened)
        self.machine.loops += 1
        for bus, axes in groups.items():
            members = [LoopAxis(axis) for axis in axes]
            stream, reads = opened[bus]
            self.groups.append(BusGroup(bus, {one.config.node: one for one in members}, stream, reads))
            self.axes |= {one.name: one for one in members}
        self._settle_rate()
        for _ in range(ENTRY_TRIES):
            missing = self._absorb(await self._read())
            if not missing:
                break
        else:
            first = self.axes[min(missing)]
            raise NoReply(f"{', '.join(sorted(missing))}: no reply", node=first.axis.config.node)
        for axis in self.axes.values():
            axis.restart()

    def _settle_rate(self) -> None:
        """Choose the rate, or check that the wire carries it; goals need about as much as the positions."""
        cycle = max(
            sum(group.bus.driver.air_time(request, group.bus.rate) for request in group.reads)
            for group in self.groups
        )
        most = 1 / cycle if cycle else inf
        self.rate = self.rate or max(MIN_RATE, min(USUAL_RATE, WIRE_SHARE * most))
        if self.rate > most:
            raise RequestError(
                f"{self.rate:g} Hz are too fast: a cycle needs {cycle * 1000:.3g} ms on the wire",
                expected=f"at most {WIRE_SHARE * most:.0f} Hz",
            )
        self.statistics.rate = self.rate

    async def _read(self) -> Mapping[BaseBus, Any]:
        batches = {group.bus: group.reads for group in self.groups if group.reads}
        return await Exchange(batches) if batches else {}

    async def wait(self) -> None:
        """Wait until 2 ms before the next slot: a target that is set then is sent in that slot."""
        pause = self._next + 1 / self.rate - LEAD - self.machine.now()
        if self.slot >= 0 and pause > 0:
            await OnBuses({self.groups[0].bus: Sleep(pause)})

    async def cycle(self) -> LoopState:
        """Send the next goals in the next slot of the grid, read all positions, publish the state."""
        await self._begin()
        self._check_owned()
        periods = self._schedule(self.machine.now())
        await self._refresh(self._next)
        await self._turn_wheels(periods)
        once, self.once = self.once, {}
        batches: dict[BaseBus, Sequence[Request[Any]]] = {
            group.bus: (*group.goals(self._goals(group, periods)), *group.reads) for group in self.groups
        }
        for bus, requests in once.items():
            batches[bus] = [*requests, *batches.get(bus, ())]
        # Without any request the exchange still waits for the slot.
        values = await Exchange(
            {bus: batch for bus, batch in batches.items() if batch} or batches, self._next
        )
        missing = self._absorb(values)
        self.statistics.cycles += 1
        positions = {name: axis.position for name, axis in self.axes.items()}
        state = LoopState(self.slot, self.machine.now(), positions, missing)
        self.machine.publish()
        self._check(values, missing)
        for bus, requests in once.items():
            raise_first(dict(enumerate(values[bus][: len(requests)])))
        await self._look()
        return state

    async def read(self) -> Mapping[str, float]:
        """Read all positions (rad, m) now, without the clock of the loop."""
        values = await self._read()
        missing = self._absorb(values)
        self.machine.publish()
        self._check(values, missing)
        return {name: axis.position for name, axis in self.axes.items()}

    async def write(self, targets: Mapping[str, float], elapsed: float) -> Mapping[str, float]:
        """Send targets now, `elapsed` s after the last ones; gives what was sent, within the limits."""
        for name, target in targets.items():
            self.set_target(name, target)
        await self._begin()
        await self._refresh(self.machine.now())
        periods = max(1, round(elapsed * self.rate))
        await self._turn_wheels(periods)
        batches = {group.bus: group.goals(self._goals(group, periods)) for group in self.groups}
        values = await Exchange({bus: batch for bus, batch in batches.items() if batch} or batches)
        self._check(values, frozenset())
        await self._look()
        return {name: axis.sent for name, axis in self.axes.items()}

    async def _refresh(self, at: float) -> None:
        """Read all positions again if one is too old, or too doubtful, to judge a goal at this time (s)."""
        led = [axis.status for axis in self.axes.values() if axis.owner is not None]
        if any(one.suspect is not None or (one.measured and at - one.at > STALE) for one in led):
            self._absorb(await self._read())

    async def leave(self, error: BaseException | None) -> None:
        """Brake the axes that are still moving, within their limits; then the loop sends nothing more."""
        try:
            if error is None:
                await self._brake()
                self.settle()
        finally:
            self.close()

    async def _brake(self) -> None:
        owned = [axis for axis in self.axes.values() if axis.owner is not None and not self.direct]
        for axis in owned:
            axis.target = 0.0 if axis.config.is_wheel else axis.generator.brake()
        while any(axis.owner is not None and not self._rests(axis) for axis in owned):
            await self.cycle()

    def settle(self) -> None:
        """The axes that the loop owns have come to rest."""
        for axis in self.axes.values():
            if axis.owner is not None and axis.owner == axis.status.owner:
                axis.status.moving = axis.status.endless = False

    def close(self) -> None:
        """Send nothing more."""
        for axis in self.axes.values():
            axis.release()
            self.machine.targets.pop(axis.name, None)
        self.machine.loops -= bool(self.groups)
        self.groups = []

    def _rests(self, axis: LoopAxis) -> bool:
        return not axis.sent if axis.config.is_wheel else axis.generator.arrived

    # -- parts of a cycle ------------------------------------------------------------------------------------------

    def _schedule(self, now: float) -> int:
        """Take the next slot; a slot that has begun is an overrun, whole slots that are gone are skipped."""
        period = 1 / self.rate
        if self.slot < 0:
            self.slot, self._next = 0, now
            return 1
        self.slot += 1
        self._next += period
        late = now - self._next
        if late <= 1e-6:
            return 1
        gone = int(late / period)
        self.statistics.overruns += 1
        self.statistics.skipped += gone
        self.slot += gone
        self._next += gone * period
        if late > STALL and any(axis.owner is not None for axis in self.axes.values()):
            raise Interrupted(
                f"the program was held up for {late:.2f} s while it led axes", advice="move again"
            )
        return 1 + gone

    def _goals(self, group: BusGroup, periods: int) -> dict[int, float]:
        goals = {}
        for node, axis in group.axes.items():
            if axis.owner is None or axis.target is None or axis.missed > MAX_MISSED or axis.config.is_wheel:
                continue
            if axis.status.suspect is not None:
                continue
            if self.direct and axis.behind:
                one_cycle = axis.config.max_velocity / self.rate
                axis.behind = abs(axis.target - axis.sent) > one_cycle
            if self.direct and not axis.behind:
                axis.sent = axis.target
            else:
                if periods > CATCH_UP:
                    axis.generator.reset(axis.sent)
                axis.sent = axis.generator.step(min(periods, CATCH_UP) / self.rate, axis.target)
            goals[node] = axis.config.to_device(axis.sent)
        return goals

    async def _turn_wheels(self, periods: int) -> None:
        """Bring the velocity of each wheel nearer to its target, within its acceleration."""
        changed = []
        for axis in self.axes.values():
            config = axis.config
            if not config.is_wheel or axis.owner is None or axis.target is None:
                continue
            most = inf if self.direct else config.acceleration * min(periods, CATCH_UP) / self.rate
            step = min(max(axis.target - axis.sent, -most), most)
            if step:
                axis.sent += step
                changed.append(axis.axis)

        async def turn(axis: Axis) -> None:
            one = self.axes[axis.name]
            if one.owner == one.status.owner:  # no stop has taken it
                await axis.driver.set_velocity(axis.device, one.sent * one.config.ratio)

        if changed:
            raise_first(await on_axes(changed, turn))

    def _absorb(self, values: Mapping[BaseBus, Any]) -> frozenset[str]:
        """Take the positions of a cycle; the names of the axes without one."""
        missing = []
        for group in self.groups:
            if not group.reads:
                continue
            found: dict[int, float] = {}
            at = 0.0
            replies = values.get(group.bus)
            for reply in replies if isinstance(replies, list) else ():
                if isinstance(reply, Positions):
                    found |= reply.values
                    at = reply.at
            for node, axis in group.axes.items():
                angle = found.get(node)
                if angle is not None and axis.status.take(angle, at):
                    axis.position = axis.config.from_device(angle)
                    if axis.missed > MAX_MISSED and axis.owner is not None:
                        axis.restart()
                        axis.behind = True
                    axis.missed = 0
                    continue
                self.statistics.lost[axis.name] = self.statistics.lost.get(axis.name, 0) + 1
                axis.silent_since = axis.silent_since if axis.missed else self.machine.now()
                axis.missed += 1
                missing.append(axis.name)
        return frozenset(missing)

    async def _begin(self) -> None:
        """Torque on, without a jump, for axes with a first target."""
        fresh = [axis for axis in self.axes.values() if axis.target is not None and axis.owner is None]
        if not fresh:
            return
        stopped = [axis for axis in fresh if axis.status.owner != axis.claimed]
        for axis in stopped:
            axis.release()
        if stopped:
            raise Interrupted(f"{', '.join(axis.name for axis in stopped)}: stopped before the first goal")
        for axis in fresh:
            axis.status.check_fault()
        groups = by_bus([axis.axis for axis in fresh])
        raise_first(
            await OnBuses({bus: start_axes(bus, axes, self.machine.health) for bus, axes in groups.items()})
        )
        for axis in fresh:
            if not axis.config.is_wheel:
                assert axis.status.position is not None
                axis.position = axis.config.from_device(axis.status.position)
            axis.restart()
            axis.owner = axis.status.claim()
        self.slot = -1

    async def _look(self) -> None:
        owned = [axis for axis in self.axes.values() if axis.owner is not None]
        if owned:
            goals = {a.name: a.config.to_device(a.sent) for a in owned if not a.config.is_wheel}
            await self.machine.health.look([axis.axis for axis in owned], goals)

    def _check_owned(self) -> None:
        """Raise the error if the lease is lost, or a stop or another command has taken an axis."""
        lease = self.machine.lease
        lost = [error for group in self.groups if (error := group.lost(lease)) is not None]
        if not lost and lease is not None and lease.lost:
            raise lease_lost("the loop")
        if lost:
            for axis in self.axes.values():
                if axis.owner != axis.status.owner:
                    axis.release()
            raise lost[0]

    def _check(self, values: Mapping[BaseBus, Any], missing: Iterable[str]) -> None:
        """Raise what is wrong: a silent axis first, then a lost owner, a lost bus, a refused goal."""
        for name in missing:
            axis = self.axes[name]
            silence = self.machine.now() - axis.silent_since
            if axis.owner is not None and silence > SILENCE:
                raise NoReply(
                    f"{name} ({axis.config.device}) has not answered for {silence:.2f} s while it was led",
                    cause="its cable or supply, or a device in between",
                    node=axis.config.node,
                )
        self._check_owned()
        for value in values.values():
            if isinstance(value, Refused) and value.reason == "stale":
                raise Interrupted("the program was held up while it led axes", advice="move again") from value
        raise_first(values)
        for value in values.values():
            raise_first({i: one for i, one in enumerate(value) if not isinstance(one, LOST)})


async def _open(
    bus: BaseBus, axes: list[Axis]
) -> tuple[PositionStream | None, tuple[Request[Positions], ...]]:
    """Procedure: the stream of the position axes of a bus, and the requests that read all positions."""
    led = [axis for axis in axes if not axis.config.is_wheel]
    stream = await led[0].driver.stream([axis.device for axis in led], rate=bus.rate) if led else None
    reads = list(stream.positions) if stream is not None else []
    for axis in axes:
        if axis.config.is_wheel and "position" in axis.driver:
            await axis.driver.position(axis.device)  # from then on it is one request
            request = axis.driver.position(axis.device)
            if isinstance(request, Request):
                reads.append(read_positions(axis.config.node, request))
            discard(request)
    return stream, tuple(reads)


async def start_axes(bus: BaseBus, axes: list[Axis], health: HealthMonitor) -> None:
    """Procedure: torque on, without a jump, for axes of one bus that are to follow setpoints.

    An error of a device names its axis.
    """
    try:
        await _start_axes(bus, axes, health)
    except MotorbusError as error:
        for axis in axes:
            if axis.config.node == error.node:
                name_axis(axis, error)
        raise


async def _start_axes(bus: BaseBus, axes: list[Axis], health: HealthMonitor) -> None:
    led = [axis for axis in axes if not axis.config.is_wheel]
    await gather(*[health.check_kept(axis) for axis in axes])
    before = {axis.name: bus.stop_count(axis.config.node) for axis in axes}
    for axis in axes:
        if axis.config.max_torque is not None:
            await axis.driver.cap_torque(axis.device, axis.config.max_torque)
    if led:
        stream = await led[0].driver.stream([axis.device for axis in led], rate=bus.rate)
        await stream.start(
            {axis.config.node: abs(axis.config.max_velocity * axis.config.ratio) for axis in led}
        )
        for request in stream.positions:
            found = await catch(request)
            for axis in led:
                if isinstance(found, Positions) and axis.config.node in found.values:
                    axis.status.take(found.values[axis.config.node], found.at)
    for axis in axes:
        if axis.config.is_wheel and "enable_torque" in axis.driver:
            await axis.driver.enable_torque(axis.device)
        axis.status.engaged = True
        await health.arm(axis, before[axis.name])
