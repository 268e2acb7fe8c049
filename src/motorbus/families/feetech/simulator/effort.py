"""What the world makes of a planned movement: obstacles, an outside torque, and what the motor gives at each moment.

A plan says where the registers want the shaft to go. Here it is held against what the motor may use and what the world
does. Speed and torque share one duty, as in any motor with brushes: at full duty it either turns at top speed or holds
the stall torque, and in between linearly. So a torque limit is a speed limit too, and an outside torque takes its part
of the speed. All of it is worked out once, when a movement begins, and is a function of time from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import copysign, inf
from typing import Final, NamedTuple

from motorbus.core.plant import Drive, Motion, rest, run
from motorbus.families.feetech.simulator.motor import FEEBLE, Settings
from motorbus.families.feetech.simulator.obstacle import obstructed, stretches
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import Mode


class World(NamedTuple):
    """What is done to a shaft from outside, in its own direction.

    `torque`   what the outside takes of the stall torque: positive pushes towards smaller counts
    `blocked`  the counts between which the shaft can turn; None: it is free
    """

    torque: float = 0.0
    blocked: tuple[float, float] | None = None


_NOTHING: Final = World()


class Carried(NamedTuple):
    """A movement as it really happens.

    `push`   the share of the stall torque, signed, that the motor gives in the end because it does not get its way;
             None when it does
    `again`  when it has to think again, having met an obstacle on a way that would have come back
    """

    motion: Motion
    push: float | None = None
    again: float = inf


class Load(NamedTuple):
    """What the motor does for a while: from when to when (s), duty at first and its change per s, current in A, and the
    share of the stall torque that it gives, all signed."""

    begin: float
    end: float
    duty: float
    slope: float
    current: float
    torque: float


def carried_out(
    plan: Callable[[Drive], Motion],
    wanted: Settings,
    world: World,
    at: float,
    drive: Drive,
    switches: Switches,
) -> Carried:
    """What becomes of a plan; it is asked again with a slower drive where the torque does not suffice for its speed.

    `wanted` and the plan are in the direction of the shaft.
    """
    planned = plan(drive)
    if world == _NOTHING and wanted.torque >= 1:
        return Carried(planned)  # most are like that
    if wanted.torque < FEEBLE:
        return _blocked(_let_go(planned, wanted, world, at, drive, switches), wanted, world)
    if wanted.mode is Mode.PWM and world.torque:
        return _blocked(_driven(planned, wanted, world, at, drive, switches), wanted, world)
    if wanted.mode is Mode.CURRENT:
        return _blocked(Carried(planned), wanted, world)
    way = planned.cruise or planned.goal - planned.position(at)
    if not way:
        held = abs(world.torque) <= wanted.torque
        carried = Carried(planned) if held else _let_go(planned, wanted, world, at, drive, switches)
        return _blocked(carried, wanted, world)
    spare = wanted.torque - world.torque * copysign(1.0, way)
    if spare < FEEBLE:
        carried = _let_go(planned, wanted, world, at, drive, switches, copysign(wanted.torque, way))
    elif spare < 1 and _fastest(planned) > spare * drive.top_speed:
        carried = Carried(plan(replace(drive, top_speed=spare * drive.top_speed)))
    else:
        carried = Carried(planned)
    return _blocked(carried, wanted, world)


def loads(
    motion: Motion, push: float | None, world: World, available: float, drive: Drive, since: float
) -> Iterator[Load]:
    """What the motor does from `since` on: some stretches and then, to infinity, what it does in the end."""
    torque = max(-available, min(available, world.torque))
    for begin, end, _, velocity, acceleration in stretches(motion, since):
        if end == inf and push is not None:
            yield Load(begin, end, push, 0.0, drive.current(0.0, push), push)
        else:
            turning = velocity or acceleration
            duty = velocity / drive.top_speed + torque
            current = drive.current(turning, torque)
            yield Load(begin, end, duty, acceleration / drive.top_speed, current, torque)


def _let_go(
    planned: Motion,
    wanted: Settings,
    world: World,
    at: float,
    drive: Drive,
    switches: Switches,
    push: float | None = None,
) -> Carried:
    """The outside is stronger than what the motor may use, if it is: the gear holds by its friction, or yields."""
    excess = abs(world.torque) - wanted.torque
    if switches.overpowered == "yields" and excess > FEEBLE:
        speed = copysign(min(1.0, excess) * drive.top_speed, -world.torque)
        motion = run(
            at,
            planned.position(at),
            speed,
            velocity=planned.velocity(at),
            acceleration=switches.full_acceleration,
        )
        return Carried(motion, copysign(wanted.torque, world.torque))
    if push is not None:
        return Carried(rest(at, planned.position(at)), push)
    return Carried(planned)


def _driven(
    planned: Motion, wanted: Settings, world: World, at: float, drive: Drive, switches: Switches
) -> Carried:
    """A given duty: what the outside does not take of it is speed."""
    duty = max(-wanted.torque, min(wanted.torque, wanted.duty))
    spare = duty - world.torque
    if spare * duty <= 0 and switches.overpowered != "yields":
        return Carried(rest(at, planned.position(at)), duty)
    speed = max(-1.0, min(1.0, spare)) * drive.top_speed
    motion = run(
        at,
        planned.position(at),
        speed,
        velocity=planned.velocity(at),
        acceleration=switches.full_acceleration,
    )
    return Carried(motion, duty if spare * duty <= 0 else None)


def _blocked(carried: Carried, wanted: Settings, world: World) -> Carried:
    """The same, ended by an obstacle if there is one on the way."""
    if world.blocked is None:
        return carried
    low, high = world.blocked
    motion = obstructed(carried.motion, low, high)
    if motion is carried.motion:
        return carried
    if carried.push is not None:  # it is pushed there by the outside, or holds against it
        return carried._replace(motion=motion)
    way = 1.0 if motion.goal >= high else -1.0
    if not carried.motion.cruise and low <= carried.motion.goal <= high:
        # So near that the clock does not show the way: it is there already, or this would happen again and again.
        met = motion if motion.done_at > motion.start else rest(motion.start, motion.goal)
        return Carried(met, None, met.done_at)
    return Carried(motion, way * _strength(wanted))


def _strength(wanted: Settings) -> float:
    """The share of the stall torque with which it presses."""
    if wanted.mode is Mode.PWM:
        return min(wanted.torque, abs(wanted.duty))
    if wanted.mode is Mode.CURRENT:
        return min(wanted.torque, abs(wanted.current))
    return wanted.torque


def _fastest(motion: Motion) -> float:
    return max(
        (abs(phase.velocity_after(phase.duration)) for phase in motion.phases), default=abs(motion.cruise)
    )
