"""From register values to movement: what a servo does with its shaft, as pure functions.

Three ways of counting meet here. The *shaft* is where the output shaft really is, in counts, without end in
both directions. *Zero* is the place of the shaft that reads 0; the homing offset moves it, in position mode only
(measured on STS3215 by feetech-cli and servolab), which is why the reading jumps when the mode is changed. The
*reading* is shaft minus zero, within one turn unless bit 4 of the phase register asks for full turns.
"""

from __future__ import annotations

from typing import NamedTuple

from motorbus.core.plant import Drive, Motion, move, rest, run
from motorbus.families.feetech.simulator.switches import Switches

POSITION, VELOCITY, PWM, STEP = range(4)

# Bits of the phase register; source: FEETECH notes on special bytes of STS servos.
_ZERO_IS_MAXIMUM = 1 << 3
_FULL_TURNS = 1 << 4
_NO_CURRENT_FEEDBACK = 1 << 5

FEEBLE = 10
"""A torque limit below this (1 %) does not overcome the servo's own friction. An estimate, no source."""


class Settings(NamedTuple):
    """The registers that decide about movement, as raw values; `strong` says whether the motor may push at all."""

    strong: bool
    mode: int
    goal: int
    duty: int
    goal_velocity: int
    velocity_unit: int
    acceleration: int
    low: int
    high: int
    phase: int
    zero: int
    turn: int


def reading(shaft: float, zero: int, phase: int, turn: int) -> int:
    """What the present position register says when the shaft is here."""
    counts = round(shaft) - zero
    return counts if phase & _FULL_TURNS else counts % turn


def zero_for(shaft: float, offset: int, turn: int) -> int:
    """The zero that belongs to an offset, on the turn on which the shaft is: the turn count begins anew."""
    counts = round(shaft)
    return counts - (counts - offset) % turn


def plan(settings: Settings, motion: Motion, at: float, drive: Drive, switches: Switches) -> Motion:
    """The movement these settings ask for from this moment on, taking over from `motion`."""
    shaft, velocity = motion.position(at), motion.velocity(at)
    if not settings.strong:
        return rest(at, shaft)  # limp: a gear of 1:345 holds by its friction
    acceleration = settings.acceleration * switches.acceleration_unit or switches.full_acceleration
    if settings.mode == VELOCITY:
        # 0 stops a wheel whatever bit 3 of the phase register says of moves: as shipped it would race otherwise.
        goal = _bounded(settings.goal_velocity * settings.velocity_unit, drive)
        return run(at, shaft, goal, velocity=velocity, acceleration=acceleration)
    if settings.mode == PWM:
        # A positive duty turns towards smaller angles: servolab, measured on STS3215.
        goal = _bounded(-settings.duty / 1000 * drive.top_speed, drive)
        return run(at, shaft, goal, velocity=velocity, acceleration=switches.full_acceleration)
    if settings.mode == STEP:
        place = motion.goal if motion.moving(at) and not motion.cruise else shaft
    else:
        place = _place(settings, shaft, switches)
    return _go(settings, shaft, velocity, place, at, drive, acceleration)


def step(settings: Settings, motion: Motion, at: float, drive: Drive, switches: Switches) -> Motion:
    """The movement that a write of the goal orders in step mode: so far from the last goal, or from here."""
    shaft, velocity = motion.position(at), motion.velocity(at)
    if not settings.strong:
        return rest(at, shaft)
    on_the_way = switches.step_from == "goal" and motion.moving(at) and not motion.cruise
    place = round(motion.goal if on_the_way else shaft) + settings.goal
    acceleration = settings.acceleration * switches.acceleration_unit or switches.full_acceleration
    return _go(settings, shaft, velocity, place, at, drive, acceleration)


def feels_current(phase: int) -> bool:
    """Whether this bridge measures its current at all."""
    return not phase & _NO_CURRENT_FEEDBACK


def _place(settings: Settings, shaft: float, switches: Switches) -> float:
    """Where on the shaft the goal position lies. Within one turn it never crosses the seam: STS_servos#7."""
    if settings.low == settings.high == 0:
        return settings.zero + settings.goal
    goal = min(max(settings.goal, settings.low), settings.high)
    if goal != settings.goal and switches.beyond_limits == "stay":
        return shaft
    return round(shaft) + goal - reading(shaft, settings.zero, settings.phase, settings.turn)


def _go(
    settings: Settings,
    shaft: float,
    velocity: float,
    place: float,
    at: float,
    drive: Drive,
    acceleration: float,
) -> Motion:
    speed = abs(_bounded(settings.goal_velocity * settings.velocity_unit, drive))
    if not settings.goal_velocity and settings.phase & _ZERO_IS_MAXIMUM:
        speed = drive.top_speed
    return move(at, shaft, place, velocity=velocity, speed=speed, acceleration=acceleration)


def _bounded(velocity: float, drive: Drive) -> float:
    return max(-drive.top_speed, min(drive.top_speed, velocity))
