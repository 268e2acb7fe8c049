"""From register values to movement: what a servo does with its shaft, as pure functions.

Three ways of counting meet here. The *encoder* is where the output shaft really is, in counts, without end in both
directions. *Zero* is the place of the encoder that reads 0; the homing offset moves it, in position mode only
(measured on STS3215 by feetech-cli and servolab), which is why the reading jumps when the mode is changed. The
*reading* is encoder minus zero, within one turn unless bit 4 of the phase register asks for full turns.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, inf, sqrt
from typing import Final, NamedTuple, TypeAlias

from motorbus.core.plant import Drive, Motion, Phase, move, rest, run
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import Mode

_made: Final = tuple.__new__
"""Makes a named tuple in half the time of its own call: each goal needs one."""
_MOST_TURNS = 7.5
"""How far a goal over many turns may lie to either side (STS3215 memory table V3.6: 30719 counts)."""

FEEBLE = 0.01
"""A share of the stall torque below this does not overcome the servo's own friction. An estimate, no source."""


class Settings(NamedTuple):
    """What the registers ask for, in counts and seconds.

    `torque`        share of the stall torque that the motor may give; `burden` what the outside takes of it
    `goal`          raw, as written; `low` and `high` bound it unless `endless`; `turns`: whether over many turns
    `zero`          the place of the encoder that reads 0; one turn has `turn` counts
    `mode`          None: a number that nobody explains
    `duty`          share of the supply, signed, positive towards greater counts
    `current`       the goal of constant current mode as a share of the stall current, signed
    `velocity`      goal velocity, signed; `fastest`: a velocity of 0 means as fast as it can
    `time`          s that a way takes when the velocity is 0; 0: it does not count
    `acceleration`  counts/s²
    `told`          readings count on beyond one turn
    `runs_away`     drive and feedback disagree about the direction
    `fold`          counts of the encoder for one count of a position
    """

    torque: float = 0.0
    burden: float = 0.0
    goal: int = 0
    zero: int = 0
    mode: Mode | None = Mode.POSITION
    low: int = 0
    high: int = 4095
    endless: bool = False
    turns: bool = False
    duty: float = 0.0
    current: float = 0.0
    velocity: float = 0.0
    fastest: bool = True
    time: float = 0.0
    acceleration: float = 25_400.0
    runs_away: bool = False
    told: bool = False
    turn: int = 4096
    fold: int = 1


def settings(asked: Settings, torque: float, burden: float, goal: int, zero: int) -> Settings:
    """What the registers ask for, with what changes from one movement to the next in the place of the first four."""
    return _made(Settings, (torque, burden, goal, zero, *asked[4:]))


def reading(encoder: float, zero: int, told: bool, turn: int, fold: int = 1) -> int:
    """What the present position register says when the encoder is here: within one turn unless `told` in full.

    `fold` counts of the encoder make one that is said.
    """
    counts = round(encoder) - zero
    if fold != 1:
        counts = round(counts / fold)
    return counts if told else counts % turn


def zero_for(encoder: float, offset: int, turn: int) -> int:
    """The zero that belongs to an offset, on the turn on which the shaft is: the turn count begins anew."""
    counts = round(encoder)
    return counts - (counts - offset) % turn


def mirrored(motion: Motion) -> Motion:
    """The same movement seen by a feedback that counts the other way."""
    phases = tuple(
        Phase(one.duration, -one.position, -one.velocity, -one.acceleration) for one in motion.phases
    )
    return Motion(motion.start, phases, -motion.goal, -motion.cruise)


def plan(settings: Settings, motion: Motion, at: float, drive: Drive, switches: Switches) -> Motion:
    """The movement these settings ask for from this moment on, taking over from `motion`."""
    encoder, velocity, _ = motion.state(at)
    mode = settings.mode
    if settings.torque < FEEBLE or mode is None:
        return rest(at, encoder)  # limp: a gear of 1:345 holds by its friction
    if mode is Mode.POSITION:
        return _go(settings, encoder, velocity, _place(settings, encoder, switches), at, drive)
    if mode is Mode.STEP:
        place = motion.goal if motion.moving(at) and not motion.cruise else encoder
        return _go(settings, encoder, velocity, place, at, drive)
    if mode is Mode.VELOCITY:
        # 0 stops a wheel whatever bit 3 of the phase register says of moves: as shipped it would race otherwise.
        goal = _bounded(-settings.velocity if settings.runs_away else settings.velocity, drive)
        if settings.runs_away and goal:
            goal = copysign(drive.top_speed, goal)
        return run(at, encoder, goal, velocity=velocity, acceleration=settings.acceleration)
    if mode is Mode.PWM:
        goal = _bounded(settings.duty * drive.top_speed, drive)
        return run(at, encoder, goal, velocity=velocity, acceleration=switches.full_acceleration)
    return _pushed(settings, encoder, velocity, at, drive, switches)


def step(settings: Settings, motion: Motion, at: float, drive: Drive, switches: Switches) -> Motion:
    """The movement that a write of the goal orders in step mode: so far from the last goal, or from here."""
    encoder, velocity = motion.position(at), motion.velocity(at)
    if settings.torque < FEEBLE:
        return rest(at, encoder)
    on_the_way = switches.step_from == "goal" and motion.moving(at) and not motion.cruise
    place = round(motion.goal if on_the_way else encoder) + settings.goal * settings.fold
    return _go(settings, encoder, velocity, place, at, drive)


def _pushed(
    settings: Settings, encoder: float, velocity: float, at: float, drive: Drive, switches: Switches
) -> Motion:
    """Constant current: what the outside does not take speeds the shaft up until the voltage is used up."""
    share = max(-settings.torque, min(settings.torque, settings.current))
    net = share - settings.burden
    if abs(net) < FEEBLE:
        return run(at, encoder, 0.0, velocity=velocity, acceleration=switches.full_acceleration)
    goal = copysign(drive.top_speed, net)
    return run(at, encoder, goal, velocity=velocity, acceleration=switches.full_acceleration * abs(net))


def _place(settings: Settings, encoder: float, switches: Switches) -> float:
    """Where on the encoder the goal position lies. Within one turn it never crosses the seam: STS_servos#7."""
    if settings.turns:
        far = int(_MOST_TURNS * settings.turn) - 1
        low, high = -far, far
    elif settings.endless:
        return settings.zero + settings.goal * settings.fold
    else:
        low, high = settings.low, settings.high
    goal = settings.goal
    if not low <= goal <= high:
        goal = min(max(goal, low), high)
    if goal != settings.goal and switches.beyond_limits == "stay":
        return encoder
    if settings.turns:
        return settings.zero + goal * settings.fold
    present = reading(encoder, settings.zero, settings.told, settings.turn, settings.fold)
    return round(encoder) + (goal - present) * settings.fold


def _go(settings: Settings, encoder: float, velocity: float, place: float, at: float, drive: Drive) -> Motion:
    acceleration = settings.acceleration
    if settings.runs_away and place != encoder:
        goal = copysign(drive.top_speed, encoder - place)
        return run(at, encoder, goal, velocity=velocity, acceleration=acceleration)
    speed = min(abs(settings.velocity), drive.top_speed) if settings.velocity else 0.0
    if not speed and settings.time:
        speed = min(drive.top_speed, _speed_for(abs(place - encoder), settings.time, acceleration))
    elif not speed and settings.fastest:
        speed = drive.top_speed
    return move(at, encoder, place, velocity=velocity, speed=speed, acceleration=acceleration)


def _speed_for(way: float, time: float, acceleration: float) -> float:
    """The speed of a trapezoid that goes this way from rest to rest in this time; the fastest there is if none does."""
    spare = time * time - 4 * way / acceleration
    return acceleration * (time - sqrt(spare)) / 2 if spare > 0 else inf


def _bounded(velocity: float, drive: Drive) -> float:
    return max(-drive.top_speed, min(drive.top_speed, velocity))


Planner: TypeAlias = Callable[[Settings, Motion, float, Drive, Switches], Motion]
"""`plan` or `step`."""
