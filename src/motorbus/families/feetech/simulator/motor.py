"""The movement of one motor: what its registers order, as far as torque, load and obstacles allow.

All places are counts of the encoder, without end in both directions. At full duty a motor either turns at its
top speed or gives its stall torque, and linearly in between; so a torque limit and a load are speed limits
too. A movement is worked out when it begins and is a function of time from then on.
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Final, NamedTuple

from motorbus.core.plant import Drive, Motion, Phase, move, rest, run
from motorbus.families.feetech.traits import Mode

FEEBLE: Final = 0.01
"""Share of the stall torque that the friction of the gear takes. # assumption"""
FULL_ACCELERATION: Final = 25_400.0
"""Counts/s² where the register is 0 or missing: what its highest value gives. # assumption"""
TO_A_PLACE: Final = (Mode.POSITION, Mode.STEP)


class Order(NamedTuple):
    """What registers and world ask of a motor.

    `goal`          a place; in velocity mode counts/s; in PWM and current mode a share, signed
    `speed`         counts/s of the way to a place; 0: standstill, inf: as fast as possible
    `time`          s of the way to a place if `speed` is 0; 0: not used
    `acceleration`  counts/s²
    `torque`        share of the stall torque that it may use, 0 to 1
    `load`          share that the outside takes; positive pushes to smaller counts
    `blocked`       range of places that the shaft cannot leave; None: it is free
    """

    mode: Mode
    goal: float
    speed: float
    time: float
    acceleration: float
    torque: float
    load: float
    blocked: tuple[float, float] | None


class Course(NamedTuple):
    """A movement, the load that it bears, and the torque that presses in vain at its end (None: none).

    Without torque the load is 0: the gear holds the shaft against every load. # assumption
    """

    motion: Motion
    load: float = 0.0
    push: float | None = None

    def torque(self, at: float) -> float:
        """Share of the stall torque that the motor gives."""
        return self.load if self.push is None or self.motion.moving(at) else self.push


def follow(order: Order, motion: Motion, at: float, drive: Drive) -> Course:
    """The course that an order starts from the present state of this movement."""
    load = max(-order.torque, min(order.torque, order.load))
    strength, goal = order.torque, order.goal
    if order.mode in TO_A_PLACE:
        goal -= motion.position(at)
    elif order.mode is not Mode.VELOCITY:
        strength = min(strength, abs(goal))
    way = copysign(1.0, goal) if goal else 0.0
    spare = strength - load * way
    if way and spare < FEEBLE:
        return Course(rest(at, motion.position(at)), load, way * strength)
    planned = _plan(order, motion, at, drive, way, spare)
    if order.blocked is None:
        return Course(planned, load)
    stopped, side = _stopped(planned, *order.blocked)
    return Course(stopped, load, side * strength if side else None)


def _plan(order: Order, motion: Motion, at: float, drive: Drive, way: float, spare: float) -> Motion:
    """The movement without obstacles; `spare` is the share of the torque that the load leaves for the way."""
    position, velocity, _ = motion.state(at)
    fastest, acceleration = min(1.0, spare) * drive.top_speed, order.acceleration
    if order.mode in TO_A_PLACE:
        speed = min(order.speed, fastest)
        if not speed and order.time:  # of a trapezoid from rest to rest in this time
            square = order.time**2 - 4 * abs(order.goal - position) / acceleration
            speed = min(fastest, acceleration * (order.time - sqrt(square)) / 2 if square > 0 else inf)
        return move(at, position, order.goal, velocity=velocity, speed=speed, acceleration=acceleration)
    speed = min(abs(order.goal), fastest)
    if order.mode is Mode.PWM:  # a torque limit does not limit the duty # assumption
        speed, acceleration = drive.top_speed * (abs(order.goal) - order.load * way), FULL_ACCELERATION
    elif order.mode is Mode.CURRENT:
        speed, acceleration = drive.top_speed, FULL_ACCELERATION * (spare or 1.0)
    goal = way * min(speed, drive.top_speed)
    return run(at, position, goal, velocity=velocity, acceleration=acceleration)


def _stopped(motion: Motion, low: float, high: float) -> tuple[Motion, float]:
    """The movement ended where it leaves this range, and the side (-1, 1); 0 if it never does.

    A goal inside the range is reached: an overshoot on the way is not stopped.
    """
    if not motion.cruise and low <= motion.goal <= high:
        return motion, 0.0
    phases: list[Phase] = []
    for phase in (*motion.phases, Phase(inf, motion.goal, motion.cruise, 0.0)):
        time, side = min((_time_to(low, phase, -1.0), -1.0), (_time_to(high, phase, 1.0), 1.0))
        if time < phase.duration:
            phases.append(phase._replace(duration=time))
            end = phase.position if not time else low if side < 0 else high
            return Motion(motion.start, tuple(phases), end), side
        phases.append(phase)
    return motion, 0.0


def _time_to(bound: float, phase: Phase, side: float) -> float:
    """Time (s) at which this phase crosses the bound outwards; inf if it never does."""
    distance = side * (bound - phase.position)
    velocity, acceleration = side * phase.velocity, side * phase.acceleration
    if distance <= 0:
        return 0.0 if (velocity or acceleration) > 0 else inf
    square = velocity**2 + 2 * acceleration * distance
    speed = velocity + sqrt(square) if square >= 0 else 0.0
    return 2 * distance / speed if speed > 0 else inf
