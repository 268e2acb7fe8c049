"""Teach, replay and follow: clients of the control loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.axis import Axis
from motorbus.motion.commands import LoopResult
from motorbus.motion.loop import ControlLoop, LoopState, Policy
from motorbus.motion.machine import Names
from motorbus.motion.moves import (
    Course,
    StopsIfInterrupted,
    check_reach,
    check_seconds,
    ended,
    lead,
    loop_result,
    move,
    release_torque,
)
from motorbus.motion.program import raise_first
from motorbus.motion.state import OpenMachine
from motorbus.motion.trajectory import MOST, Interpolation, Trajectory

NEAR: Final = 0.005  # rad of the device that an axis may be off the start of a trajectory


async def teach(
    machine: OpenMachine,
    names: Names = None,
    *,
    seconds: float | None = None,
    until: Callable[[], bool] | None = None,
    rate: float = 50.0,
    keep_torque: bool = False,
) -> Trajectory:
    """Record axes that are moved by hand, `rate` times per s, for `seconds` or until `until()` is true.

    Torque is switched off first and stays off, unless `keep_torque`. Without `seconds` Ctrl-C ends it, too. A
    cycle without the position of an axis gives no sample; notes say where an axis was outside its limits. The error
    that ends a recording has it as `so_far`.
    """
    check_seconds(seconds)
    chosen = machine.chosen(names)
    axes = [axis for axis in chosen if _can_be_taught(axis, keep_torque=keep_torque)]
    if not axes or (names is not None and len(axes) < len(chosen)):
        others = ", ".join(axis.name for axis in chosen if axis not in axes)
        raise RequestError(f"{others}: cannot be moved by hand and read in a loop", advice="name other axes")
    if not keep_torque:
        raise_first(await release_torque(axes))
    loop = ControlLoop(machine, [axis.name for axis in axes], rate=rate)
    samples: list[LoopState] = []
    try:
        async with loop:
            begun = machine.now()
            while not ended(machine.now() - begun, seconds, until) and len(samples) < MOST:
                state = await loop.cycle()
                if not state.missing:
                    samples.append(state)
    except MotorbusError as error:
        error.so_far = _recorded(axes, samples) if len(samples) > 1 else None
        raise
    except KeyboardInterrupt:
        if seconds is not None:
            raise
    return _recorded(axes, samples)


def _can_be_taught(axis: Axis, *, keep_torque: bool) -> bool:
    is_led = "stream" in axis.driver and not axis.config.is_wheel
    return is_led and (keep_torque or "disable_torque" in axis.driver)


def _recorded(axes: list[Axis], samples: list[LoopState]) -> Trajectory:
    times = [sample.at - samples[0].at for sample in samples]
    places = {axis.name: [sample.position[axis.name] for sample in samples] for axis in axes}
    notes = []
    for axis in axes:
        outside = [
            at for at, place in zip(times, places[axis.name], strict=True) if not axis.config.allows(place)
        ]
        if outside:
            notes.append(f"{axis.name} is outside its limits from {outside[0]:.2f} s on")
    return Trajectory(times, places, tuple(notes))


async def replay(
    machine: OpenMachine,
    trajectory: Trajectory,
    *,
    speed: float = 1.0,
    smooth: float | None = None,
    repeat: int = 1,
    interpolation: Interpolation = "spline",
    rate: float | None = None,
) -> LoopResult:
    """Play a trajectory `repeat` times, `speed` times as fast; first move to its start.

    The goals that will be sent are checked against all limits before anything moves: LimitExceeded says when the first
    one is violated. `smooth` (Hz) removes what is quicker.
    """
    if not 0 < speed <= 10 or not 1 <= repeat <= 100_000:
        raise RequestError(
            f"speed {speed}, {repeat} times", expected="speed above 0, at most 10; at least once"
        )
    names = tuple(trajectory.axes)
    axes = machine.chosen(names)
    if smooth is not None:
        trajectory = trajectory.smoothed(smooth)
    loop = ControlLoop(machine, names, rate=rate, direct=True)
    async with StopsIfInterrupted(axes), loop:
        goals = trajectory.sampled(loop.rate, interpolation, speed)
        goals.check({axis.name: axis.config for axis in axes})
        for axis in axes:
            for place in (min(goals.axes[axis.name]), max(goals.axes[axis.name])):
                check_reach(axis, place)
        begun = machine.now()
        for _ in range(repeat):
            await _play(machine, loop, goals)
    return loop_result(loop, machine.now() - begun, notes=trajectory.notes)


async def _play(machine: OpenMachine, loop: ControlLoop, goals: Trajectory) -> None:
    start = goals.positions(0.0)
    far = {
        name: place
        for name, place in start.items()
        if abs(place - loop.axes[name].position) * abs(machine.axes[name].config.ratio) > NEAR
    }
    if far:
        await move(machine, far)
        await loop.read()
        for axis in loop.axes.values():
            axis.release()
    peaks = {
        name: max(
            abs(end - here) / (later - at)
            for (here, end), (at, later) in zip(pairwise(places), pairwise(goals.times), strict=True)
        )
        for name, places in goals.axes.items()
    }
    await lead(loop, Course(goals.duration, goals.positions, peaks, goals.positions(goals.duration)), {})


async def follow(
    machine: OpenMachine,
    pairs: Mapping[str, str],
    *,
    seconds: float | None = None,
    until: Callable[[], bool] | None = None,
    rate: float = 100.0,
    policy: Policy = "clamp",
) -> LoopResult:
    """Let axes track others, `{leader: follower}`, within the limits of the followers.

    Torque of the leaders is switched off. While a leader does not answer, its follower stays at its last target;
    `held` of the result counts these cycles. Without `seconds` and `until` Ctrl-C ends it.
    """
    check_seconds(seconds)
    leaders, followers = list(pairs), list(pairs.values())
    names = [*leaders, *followers]
    if not pairs or len(set(names)) < len(names):
        raise RequestError("each axis is in one pair", expected="{leader: follower}")
    for leader, follower in pairs.items():
        first, second = (machine.axis(name).config for name in (leader, follower))
        if bool(first.travel) != bool(second.travel) or first.is_wheel or second.is_wheel:
            raise RequestError(f"{follower} cannot follow {leader}: they measure different things")
    raise_first(
        await release_torque([one for one in machine.chosen(leaders) if "disable_torque" in one.driver])
    )
    loop = ControlLoop(machine, names, rate=rate, policy=policy)
    held = dict.fromkeys(followers, 0)
    async with StopsIfInterrupted(machine.chosen(followers)), loop:
        begun = machine.now()
        while not ended(machine.now() - begun, seconds, until):
            state = await loop.cycle()
            for leader, follower in pairs.items():
                if leader in state.missing:
                    held[follower] += 1
                else:
                    loop.set_target(follower, state.position[leader])
    return loop_result(loop, machine.now() - begun, {name: count for name, count in held.items() if count})


async def replay_file(machine: OpenMachine, file: str, **options: Any) -> LoopResult:
    """Play a trajectory file. Options and errors as for `Trajectory.load` and `replay`."""
    return await replay(machine, Trajectory.load(file, machine.config.axes), **options)


async def teach_file(machine: OpenMachine, file: str, **options: Any) -> LoopResult:
    """Record into a new file. Options and errors as for `teach`; what an error leaves is in the file."""
    with Path(file).open("x") as opened:  # refused before anything is recorded
        try:
            made = await teach(machine, **options)
        except BaseException as error:
            kept = getattr(error, "so_far", None)
            if isinstance(kept, Trajectory):
                opened.write(kept.text(machine.config.axes))
                error.add_note(f"{kept.duration:.2f} s until then are in {file}")
            else:
                Path(file).unlink()
            raise
        opened.write(made.text(machine.config.axes))
    return LoopResult(made.duration, len(made.times), made.positions(made.duration), notes=made.notes)
