"""Programs that move axes of a robot: move, jog, home, stop, torque."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from math import inf, isfinite
from typing import Any, Final, NamedTuple

from motorbus.bus.base import BaseBus
from motorbus.core.family import SelfTimedMove
from motorbus.core.request import Request
from motorbus.core.steps import Guard, Sleep, catch
from motorbus.errors import (
    Interrupted,
    LimitExceeded,
    MotionError,
    MotorbusError,
    NotHomed,
    RequestError,
    Stalled,
)
from motorbus.motion.axis import Axis, by_bus, on_axes
from motorbus.motion.commands import AxisResult, LoopResult, MoveResult, StopResult, StopState
from motorbus.motion.loop import ControlLoop, LoopState, start_axes
from motorbus.motion.machine import Names
from motorbus.motion.profile import Kind, Limits, Move, synchronize
from motorbus.motion.program import Exchange, OnBuses, raise_first
from motorbus.motion.state import OpenMachine

TOLERANCE: Final = 0.05  # rad of the device; a servo under load stays 30 counts off its goal (user reports)
SETTLE_TIME: Final = 1.0  # s after the end of the profile within which an axis must be in position
LAG_TIME: Final = 0.3  # s that an axis may lag at the highest speed of its profile
LAG: Final = 0.1  # rad of the device that an axis may lag in any case
STILL: Final = 0.006  # rad; the coarsest position has counts of 0.005 rad
REST_TIME: Final = 0.1  # s for which readings must agree
REST_READS: Final = 3
REST_PERIOD: Final = 0.02  # s
WATCH_TIME: Final = 1.0  # s
NOTE_TIME: Final = 0.3  # s that an interrupted axis is watched, to say where it stopped


class StopsIfInterrupted(Guard):
    """An error or interrupt inside the block stops these axes; notes of the error say what became of each."""

    def __init__(self, axes: list[Axis]) -> None:
        self._axes = axes

    async def leave(self, error: BaseException | None) -> None:
        if error is None:
            return
        moving = [axis for axis in self._axes if axis.status.moving and not axis.status.fault]
        for axis in moving:
            axis.status.estimate = None
        results = await stop_axes(moving)
        accepted = [axis for axis in moving if not isinstance(results[axis.name], MotorbusError)]
        await on_axes(accepted, lambda axis: watch_rest(axis, NOTE_TIME))
        for axis in moving:
            result, position = results[axis.name], axis.status.known_position
            if isinstance(result, MotorbusError):
                text = f"not stopped: {result.summary}"
            else:
                text = result.promise if position is None else f"stopped at {axis.config.show(position)}"
            error.add_note(f"{axis.name}: {text}")


# -- move ------------------------------------------------------------------------------------------------------


async def move(
    machine: OpenMachine,
    goals: Mapping[str, float],
    *,
    duration: float | None = None,
    speed: float = 1.0,
    kind: Kind = "trapezoid",
    relative: bool = False,
    velocity: float | None = None,
    tolerance: float = TOLERANCE,
    timeout: float = SETTLE_TIME,
) -> MoveResult:
    """Move axes to these goals (rad, m), or by these distances; all start and end together.

    All goals are checked before anything is sent. `speed` is a share of the velocity and acceleration of each axis,
    `velocity` (rad/s, m/s) the highest of each, `tolerance` in rad of the device; each axis must be in position within
    `timeout` s after the end. Raises RequestError, LimitExceeded, NotHomed before anything moves; Stalled, NoReply,
    Faulted, Overloaded, Interrupted when a stop was sent to all.
    """
    axes = [machine.axis(name) for name in goals]
    if not (isfinite(speed) and 0 < speed <= 1):
        raise RequestError(f"speed {speed}", expected="above 0, at most 1")
    if velocity is not None and not (isfinite(velocity) and velocity > 0):
        raise RequestError(f"velocity {velocity}", expected="a finite number above 0")
    for axis in axes:
        _check_goal(axis, goals[axis.name], relative=relative)
    limits = {
        axis.name: Limits(
            min(axis.config.max_velocity * speed, velocity or inf), axis.config.acceleration * speed**2
        )
        for axis in axes
    }
    led = [axis.name for axis in axes if axis.follows_setpoints]
    timed = _TimedAxes([axis for axis in axes if not axis.follows_setpoints])
    loop = ControlLoop(machine, led, direct=True) if led else None
    async with timed, StopsIfInterrupted(axes), loop or nullcontext():
        moves = {}
        for name, one in loop.axes.items() if loop else ():
            goal = goals[name] + (one.position if relative else 0.0)
            check_reach(one.axis, goal)
            moves[name] = Move(one.position, goal, limits[name])
        await timed.plan(goals, limits, relative=relative)
        profile = synchronize(moves, kind=kind, duration=duration, shortest=timed.shortest)
        longest = timed.fit(profile.duration)
        if longest > profile.duration:
            profile = synchronize(moves, kind=kind, duration=longest, shortest=timed.shortest)
        await timed.prepare(profile.duration)
        begun = machine.now()
        if loop is None:
            await timed.start()
        else:
            period = 1 / loop.rate

            def positions(elapsed: float) -> Mapping[str, float]:
                timed.estimate(min(elapsed - period, profile.duration))  # `elapsed` is that of the next slot
                return profile.positions(elapsed)

            peaks = {name: one.peak for name, one in profile.profiles.items()}
            ends = {name: one.goal for name, one in moves.items()}
            course = Course(profile.duration, positions, peaks, ends)
            begun = await lead(loop, course, timed.starts, tolerance, timeout)
        await timed.end()
    results = {
        name: AxisResult(
            moves[name].goal if name in moves else goal,
            machine.axes[name].status.known_position,
            estimated=name not in moves,
        )
        for name, goal in goals.items()
    }
    return MoveResult(results, profile.duration, machine.now() - begun, profile.limited_by)


async def pose(
    machine: OpenMachine, name: str, duration: float | None = None, speed: float = 1.0
) -> MoveResult:
    """Move to a pose of the machine file. Errors as for `move`."""
    poses = machine.config.poses
    if name not in poses:
        raise RequestError(f"no pose {name!r}", expected=f"one of {', '.join(poses) or 'none'}")
    return await move(machine, poses[name], duration=duration, speed=speed)


def _check_goal(axis: Axis, goal: float, *, relative: bool) -> None:
    config = axis.config
    axis.status.check_fault()
    if config.is_wheel:
        raise RequestError(f"{axis.name}: a wheel has no position", advice="jog it", node=config.node)
    if not axis.follows_setpoints:
        axis.require("plan_move")
        if axis.status.estimate is None and not (relative and axis.range == (-inf, inf)):
            raise NotHomed(f"{axis.name}: its position is not known", advice=f'robot.home("{axis.name}")')
    if not isfinite(goal):
        raise LimitExceeded(f"{axis.name}: {goal} is not finite", node=config.node)
    if not relative:
        check_reach(axis, goal)


def check_reach(axis: Axis, goal: float) -> None:
    """Raise LimitExceeded for a goal (rad, m) outside the limits of an axis and its device."""
    low, high = axis.range
    if not low - 1e-9 <= goal <= high + 1e-9:
        show = axis.config.show
        raise LimitExceeded(
            f"{axis.name}: goal {show(goal)} is outside {show(low)} to {show(high)}", node=axis.config.node
        )


class _TimedAxes(Guard):
    """The self-timed axes of a move.

    After an error each, which was stopped then, gives back what it borrowed.
    """

    def __init__(self, axes: list[Axis]) -> None:
        self._axes = axes
        self._before = {axis.name: axis.status.estimate for axis in axes}
        self._plans: dict[str, SelfTimedMove] = {}

    async def plan(self, goals: Mapping[str, float], limits: Mapping[str, Limits], *, relative: bool) -> None:
        """Make the plan of each; an axis that needs no step of its device is left out."""

        def plan(axis: Axis) -> Any:
            config, start, goal = axis.config, axis.status.estimate, goals[axis.name]
            if relative:
                angle = goal * config.ratio
                if start is not None:
                    check_reach(axis, config.from_device(start + angle))
            else:
                assert start is not None
                angle = config.to_device(goal) - start
            velocity, acceleration = (abs(limit * config.ratio) for limit in limits[axis.name])
            return axis.driver.plan_move(axis.device, angle, velocity=velocity, acceleration=acceleration)

        plans = await on_axes(self._axes, plan)
        raise_first(plans)
        self._plans = plans
        self._axes = [axis for axis in self._axes if plans[axis.name].angle]

    @property
    def shortest(self) -> float:
        """The shortest duration (s) of all."""
        return max((one.shortest for one in self._plans.values()), default=0.0)

    def fit(self, duration: float) -> float:
        """The nearest duration (s) that is possible for each, not below this one."""
        return max((one.fit(duration) for one in self._plans.values()), default=duration)

    async def prepare(self, duration: float) -> None:
        raise_first(await on_axes(self._axes, lambda axis: self._plans[axis.name].prepare(duration)))

    @property
    def starts(self) -> dict[BaseBus, list[Request[Any]]]:
        """The requests that start them."""
        return {axis.bus: [self._plans[axis.name].start] for axis in self._axes}

    async def start(self) -> None:
        """Start them without a loop."""
        for values in (await Exchange(self.starts)).values() if self._axes else ():
            raise_first(dict(enumerate(values)) if isinstance(values, list) else {0: values})

    def estimate(self, elapsed: float) -> None:
        """Where they are by their plans."""
        for axis in self._axes:
            before = self._before[axis.name]
            if before is not None:
                axis.status.estimate = before + self._plans[axis.name].position(elapsed)

    async def end(self) -> None:
        """Wait for their ends."""
        raise_first(await self._finish())
        for axis in self._axes:
            _moved(axis, self._before[axis.name], self._plans[axis.name].angle)

    async def _finish(self) -> dict[str, Any]:
        planned = [axis for axis in self._axes if axis.name in self._plans]
        return await on_axes(planned, lambda axis: self._plans[axis.name].finish())

    async def leave(self, error: BaseException | None) -> None:
        if error is None:
            return
        for axis in self._axes:
            if axis.status.estimate != self._before[axis.name]:
                axis.status.estimate = None
        for name, result in (await self._finish()).items():
            if isinstance(result, MotorbusError) and not isinstance(result, Interrupted):
                error.add_note(f"{name}: {result.summary}")


class Course(NamedTuple):
    """A movement of the axes of a loop: its duration (s), positions (rad, m) over time, peak speeds, goals."""

    duration: float
    positions: Callable[[float], Mapping[str, float]]
    peaks: Mapping[str, float]
    goals: Mapping[str, float]


async def lead(
    loop: ControlLoop,
    course: Course,
    starts: Mapping[BaseBus, list[Request[Any]]],
    tolerance: float = TOLERANCE,
    timeout: float = SETTLE_TIME,
) -> float:
    """Program: lead the axes of a direct loop along a course until they are in position; gives the start (s).

    `starts` leave with the first goals. Raises Stalled for an axis that does not follow, or is not in position within
    `timeout` s after the end.
    """
    for name in course.peaks:
        loop.set_target(name, loop.axes[name].position)
    await loop.cycle()  # torque on
    loop.once = dict(starts)
    first: LoopState | None = None
    while True:
        elapsed = 0.0 if first is None else (loop.slot + 1 - first.number) / loop.rate
        positions = course.positions(elapsed + 1 / loop.rate)
        for name in course.peaks:
            loop.set_target(name, positions[name])
        state = await loop.cycle()
        if first is None:
            first = state
            continue
        await _check_lag(loop, course, (state.number - first.number) / loop.rate)
        over = state.at - first.at - course.duration
        late = [name for name in course.peaks if _error(loop, name, course.goals[name]) > tolerance]
        if over >= 0 and not late:
            loop.settle()
            return first.at
        if over > timeout:
            goal = loop.axes[late[0]].show(course.goals[late[0]])
            raise await _stalled(loop, late[0], f"is not in position: its goal is {goal}")


async def _check_lag(loop: ControlLoop, course: Course, elapsed: float) -> None:
    wanted = course.positions(elapsed)
    for name, peak in course.peaks.items():
        axis = loop.axes[name]
        most = max(LAG, LAG_TIME * peak * abs(axis.config.ratio))
        if not axis.missed and _error(loop, name, wanted[name]) > most:
            raise await _stalled(loop, name, f"does not follow: it should be at {axis.show(wanted[name])}")


async def _stalled(loop: ControlLoop, name: str, what: str) -> MotionError:
    axis = loop.axes[name].axis
    await loop.machine.health.examine(axis)
    return Stalled(
        f"{name} {what}, it is at {axis.config.show(loop.axes[name].position)}",
        cause="something blocks it, the load is too heavy, or it is slower than max_velocity",
        advice="clear the way, or move slower",
        node=axis.config.node,
    )


def _error(loop: ControlLoop, name: str, goal: float) -> float:
    axis = loop.axes[name]
    return abs((axis.position - goal) * axis.config.ratio)


# -- jog, home, run --------------------------------------------------------------------------------------------


async def jog(
    machine: OpenMachine,
    name: str,
    velocity: float,
    seconds: float | None = None,
    until: Callable[[], bool] | None = None,
) -> LoopResult:
    """Move an axis at `velocity` (rad/s, m/s), for `seconds`, or until `until()` is true; then brake and hold.

    A position axis stops at its limits. A wheel needs a lease, for its motion has no end of its own.
    """
    axis = machine.axis(name)
    config = axis.config
    if not 0 < abs(velocity) <= config.max_velocity:
        raise LimitExceeded(
            f"{name}: velocity {config.show(velocity)}/s",
            expected=f"at most {config.show(config.max_velocity)}/s",
        )
    check_seconds(seconds)
    if not axis.follows_setpoints:
        return await _jog_self_timed(machine, axis, velocity, seconds)
    loop = ControlLoop(machine, [name], policy="clamp")
    async with StopsIfInterrupted([axis]), loop:
        led = loop.axes[name]
        end = led.high if velocity > 0 else led.low
        if not config.is_wheel:
            led.generator.limits = Limits(abs(velocity), config.acceleration)
        begun = machine.now()
        while not ended(machine.now() - begun, seconds, until):
            if config.is_wheel:
                loop.set_target(name, velocity)
            elif isfinite(end):
                loop.set_target(name, end)
            else:
                loop.set_target(name, led.position + velocity * 2.0 + led.generator.velocity)
            await loop.cycle()
    return loop_result(loop, machine.now() - begun)


async def _jog_self_timed(
    machine: OpenMachine, axis: Axis, velocity: float, seconds: float | None
) -> LoopResult:
    axis.require("jog")
    if seconds is None:
        raise RequestError(f"{axis.name}: a jog of this device needs a time", expected="seconds")
    start, begun = axis.status.estimate, machine.now()
    if start is not None:
        check_reach(axis, axis.config.from_device(start) + velocity * seconds)
    async with StopsIfInterrupted([axis]):
        moved = (
            await on_axes(
                [axis], lambda one: one.driver.jog(one.device, velocity * one.config.ratio, seconds)
            )
        )[axis.name]
        raise_first({axis.name: moved})
    _moved(axis, start, getattr(moved, "angle", None))
    position = axis.status.known_position
    return LoopResult(machine.now() - begun, 0, {} if position is None else {axis.name: position})


def _moved(axis: Axis, start: float | None, angle: float | None) -> None:
    """An axis without position has turned by this angle (rad, estimated; None: unknown)."""
    axis.status.estimate = None if start is None or angle is None else start + angle
    axis.status.moving = axis.status.endless = False


async def home(
    machine: OpenMachine, names: Names = None, timeout: float = 30.0, velocity: float | None = None
) -> dict[str, float]:
    """Move to the reference switches, all buses at the same time, at most `timeout` s; gives the positions.

    `velocity` (rad/s, m/s): None is that of the device.
    """
    axes = machine.chosen(names)
    if names is None:
        axes = [axis for axis in axes if "home" in axis.driver]
    if not axes:
        raise RequestError("no axis has a reference switch")
    for axis in axes:
        axis.require("home")

    def visit(axis: Axis) -> Any:
        speed = {} if velocity is None else {"velocity": abs(velocity * axis.config.ratio)}
        return axis.driver.home(axis.device, deadline=timeout, **speed)

    async with StopsIfInterrupted(axes):
        results = await on_axes(axes, visit)
        for axis in axes:
            if not isinstance(results[axis.name], MotorbusError):
                _moved(axis, 0.0, 0.0)
        raise_first(results)
    return {axis.name: axis.config.from_device(0.0) for axis in axes}


async def run_stored(machine: OpenMachine, name: str, number: int, timeout: float | None = None) -> str:
    """Run a stored program of the device of an axis; its position is unknown then."""
    axis = machine.axis(name)
    axis.require("run")
    axis.status.claim()
    axis.status.estimate = None
    extra = {} if timeout is None else {"timeout": timeout}
    async with StopsIfInterrupted([axis]):
        results = await on_axes([axis], lambda one: one.driver.run(one.device, number, **extra))
        raise_first(results)
    axis.status.moving = axis.status.endless = False
    return str(results[name])


# -- stop, torque ----------------------------------------------------------------------------------------------


async def stop(machine: OpenMachine, names: Names = None, *, verify: bool = False) -> StopResult:
    """Stop these axes and hold; every axis is visited. `verify`: watch for 1 s at most until each rests.

    Raises the error of the first axis that did not accept it, with a note for each other.
    """
    axes = machine.chosen(names)
    results = await stop_axes(axes)
    raise_first(results)
    if verify:
        seen = await on_axes(axes, watch_rest)
        raise_first(seen)
        for axis in axes:
            position = axis.status.known_position
            results[axis.name] = StopState(results[axis.name].promise, seen[axis.name], position)
    machine.publish()
    return StopResult(results)


async def stop_axes(axes: list[Axis]) -> dict[str, Any]:
    """Program: stop these axes, all at the same time; gives the StopState or the error of each."""
    for axis in axes:
        axis.status.stopped()
    return await on_axes(axes, _stop)


async def _stop(axis: Axis) -> StopState:
    if axis.bus.latched:
        return StopState("the emergency stop is in force")
    axis.require("stop")
    promise = await axis.driver.stop(axis.device)
    return StopState(getattr(promise, "value", str(promise)))


async def watch_rest(axis: Axis, seconds: float = WATCH_TIME) -> bool | None:
    """Procedure: whether an axis is seen at rest within `seconds`; None where its device reports no position."""
    if "position" not in axis.driver:
        return None
    seen: list[tuple[float, float]] = []
    end = axis.bus.now() + seconds
    while axis.bus.now() < end:
        angle = await catch(axis.driver.position(axis.device))
        if isinstance(angle, MotorbusError):
            seen = []
        else:
            now = axis.bus.now()
            axis.status.take(angle, now)
            seen = [one for one in seen if abs(one[1] - angle) <= STILL]
            seen.append((now, angle))
            if len(seen) >= REST_READS and now - seen[0][0] >= REST_TIME:
                return True
        await Sleep(REST_PERIOD)
    return False


async def enable_torque(machine: OpenMachine, names: Names = None) -> tuple[str, ...]:
    """Torque on without a jump: each axis holds its position, a wheel stands. Gives the names of the axes.

    A loop or move that leads one of them ends. Without `names`: all that can.
    """
    axes = _able(machine, names, lambda axis: axis.follows_setpoints, "on")
    for axis in axes:
        axis.status.check_fault()
        axis.status.stopped()
    groups = by_bus(axes)
    raise_first(
        await OnBuses({bus: start_axes(bus, members, machine.health) for bus, members in groups.items()})
    )
    machine.publish()
    return tuple(axis.name for axis in axes)


async def disable_torque(machine: OpenMachine, names: Names = None) -> tuple[str, ...]:
    """Torque off; gives the names of the axes. Without `names`: all that can."""
    axes = _able(machine, names, lambda axis: "disable_torque" in axis.driver, "off")
    raise_first(await release_torque(axes))
    machine.publish()
    return tuple(axis.name for axis in axes)


def _able(machine: OpenMachine, names: Names, can: Callable[[Axis], bool], way: str) -> list[Axis]:
    axes = machine.chosen(names)
    able = [axis for axis in axes if can(axis)]
    if names is not None and len(able) < len(axes):
        others = ", ".join(axis.name for axis in axes if axis not in able)
        raise RequestError(f"{others}: torque cannot be switched {way}")
    return able


async def release_torque(axes: list[Axis]) -> dict[str, Any]:
    """Program: torque off; gives None or the error of each axis."""

    async def release(axis: Axis) -> None:
        axis.status.stopped()
        await axis.driver.disable_torque(axis.device)
        axis.status.engaged = False

    return await on_axes(axes, release)


# -- shared by the clients of the loop -------------------------------------------------------------------------


def check_seconds(seconds: float | None) -> None:
    """Raise RequestError for a time that is not finite and above 0."""
    if seconds is not None and not (isfinite(seconds) and seconds > 0):
        raise RequestError(f"{seconds} s", expected="a finite number above 0")


def ended(elapsed: float, seconds: float | None, until: Callable[[], bool] | None) -> bool:
    """Whether a run of the loop is over."""
    return (seconds is not None and elapsed >= seconds - 1e-9) or (until is not None and until())


def loop_result(
    loop: ControlLoop, duration: float, held: Mapping[str, int] | None = None, notes: tuple[str, ...] = ()
) -> LoopResult:
    """What became of a run of the loop."""
    positions = {axis.name: axis.position for axis in loop.axes.values()}
    statistics = loop.statistics
    return LoopResult(duration, statistics.cycles, positions, statistics.overruns, dict(held or {}), notes)
