"""How long one move takes, and what to say to the controller so that it takes as long as somebody wants.

A move of so many pulses has three numbers that make it longer: its speed in whole RPM, the frequency it starts with,
and the number of its ramp. Slow speeds are far apart, 1 RPM is half of 2; another step angle gives some in between.
There are durations that none of them gives: then the next longer one is offered. Of all that take so long the slowest
speed is chosen: it leans least on the ramp, of which nobody knows how the controller reads it.

All durations are *estimated*: reckoned with the usual reading of the acceleration, from the first pulse to the last.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from math import tau
from typing import Final

from motorbus.errors import RequestError
from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.jogging import less_than_a_pulse, paced, shaped, start_below
from motorbus.families.stepper.driver.turning import finite
from motorbus.families.stepper.execution import Motion, Ramp
from motorbus.families.stepper.program.plan import READINGS
from motorbus.families.stepper.table import Project, Step
from motorbus.families.stepper.table.project import HUNDREDTHS_PER_TURN

SPEEDS: Final = 40
"""So many speeds are tried for the quickest move, each a tenth below the one before."""
GENTLER: Final = 0.75
"""The start frequency is lowered to such a part of itself at most, to make a move longer: the first pulse comes later
for it, and in no reading of the ramp by as much as in another."""
_MOST: Final = 0xFFFF
"""The greatest speed (RPM) and acceleration (Hz) that a frame holds."""
_DISTANCE: Final = 0xFFFFFF
_ANGLES: Final = 0xFF
_ROUNDING: Final = 1e-9
_HALVES: Final = 40
"""How often what is left between two frequencies is halved: to a millionth of a millionth."""


def moved(project: Project) -> Motion:
    """The single move of its step 1. Raises RequestError for one of less than a pulse."""
    count, _ = execution.pulses(project, project.step(1))
    if not count:
        raise less_than_a_pulse(project)
    return execution.move(project, project.step(1), count)


def first_pulse(project: Project) -> float:
    """s from the moment its single move is begun to the first pulse of it, which comes at the end of a period."""
    return moved(project).moment(1)


def lasts(project: Project) -> float:
    """s from the first pulse of its single move to the last; 0 for a move of one pulse."""
    move = moved(project)
    return move.duration - move.moment(1) if move.pulses != 1 else 0.0


def quickest(project: Project, angle: float, velocity: float, acceleration: float | None) -> Project:
    """The project with the shortest move by this angle (rad) that is at most so fast (rad/s) and so steep (rad/s²).

    The number of the ramp is such that no reading of it is steeper, and never below 1, the gentlest that there is;
    where no acceleration is said it is that of step 1, or that of the manual's example. So is the start frequency.
    Raises RequestError for an angle of less than a pulse or too far, and as `check`.
    """
    check(angle, velocity, acceleration)
    most = _whole_rpm(velocity)
    turn = float(project.pulses_per_turn or Fraction(0))
    steepest = None if acceleration is None else acceleration / tau * turn
    made = shaped(project, angle)
    speeds = sorted({max(1, round(most * 0.9**lower)) for lower in range(SPEEDS)})
    tried = [paced(made, rpm, _number(rpm * turn / 60, steepest)) for rpm in speeds]
    return min(tried, key=lasts)


def check(angle: float, velocity: float, acceleration: float | None) -> None:
    """Raise RequestError for numbers that are not finite, a velocity below 1 RPM, and no acceleration above 0."""
    finite(angle, "angle")
    _whole_rpm(finite(velocity, "velocity"))
    if acceleration is not None and finite(acceleration, "acceleration") <= 0:
        raise RequestError(
            f"acceleration: {acceleration!r} rad/s² is not possible",
            expected="above 0",
            advice="nothing was sent",
        )


def fitted(quick: Project, seconds: float) -> Project:
    """Of moves that are no faster and no steeper than this one, the nearest that takes as long or longer (s).

    Where it cannot be so slow, the slowest that there is.
    """
    found = _offers(quick, seconds)
    enough = [one for one in found if lasts(one) >= seconds]
    return min(enough, key=lasts) if enough else max(found, key=lasts)


def nearest(quick: Project, seconds: float) -> Project:
    """Of the same moves the one that takes most nearly so long (s), longer or shorter."""
    return min(_offers(quick, seconds), key=lambda one: abs(lasts(one) - seconds))


def _offers(quick: Project, seconds: float) -> list[Project]:
    """Moves whose durations lie around this one (s), on either side of it where there are such."""
    if lasts(quick) >= seconds:
        return [quick]
    wanted = _frequency(quick, seconds)
    around = [_said(quick, *speed) for angle in _angles(quick) for speed in _around(quick, angle, wanted)]
    base = min((one for one in around if _hertz(one) >= wanted), key=_hertz, default=quick)
    slower = [one for one in around if _hertz(one) < wanted]
    return [base, _stretched(base, seconds), *([max(slower, key=_hertz)] if slower else [])]


def _frequency(quick: Project, seconds: float) -> float:
    """The running frequency (Hz), at most that of this move, with which it would take so long (s)."""
    low, high = 0.0, _hertz(quick)
    for _ in range(_HALVES):
        middle = (low + high) / 2
        low, high = (low, middle) if _would_last(quick, middle) <= seconds else (middle, high)
    return high


def _would_last(quick: Project, hertz: float) -> float:
    """`lasts` at a running frequency (Hz) that need not be one of a whole speed."""
    step = quick.step(1)
    ramp = execution.ramp_of(replace(step, start_frequency=start_below(step, hertz)))
    move = execution.motion(moved(quick).pulses, hertz, ramp)
    return move.duration - move.moment(1)


def _angles(quick: Project) -> list[int]:
    """The step angle of the motor, and others that may be said in its place, in hundredths of a degree.

    RPM are whole, and are made pulses by the step angle. So one that the motor does not have gives speeds in between,
    and changes nothing else where distances are said in pulses. Only such are taken with which the pulses of a turn are
    whole, for no arithmetic loses one then. That the controller does no more with it than this is an assumption.
    """
    turn = quick.pulses_per_turn
    if turn is None or quick.turn_distance != turn.numerator:
        return [quick.step_angle]
    hundredths = HUNDREDTHS_PER_TURN * quick.microsteps
    others = [angle for angle in range(1, _ANGLES + 1) if not hundredths % angle]
    return [quick.step_angle, *(angle for angle in others if hundredths // angle <= _DISTANCE)]


def _around(quick: Project, angle: int, wanted: float) -> list[tuple[int, int]]:
    """The two speeds (RPM) around this frequency (Hz), if not too high, each behind this step angle."""
    unit = HUNDREDTHS_PER_TURN * quick.microsteps / angle / 60
    near = int(wanted / unit)
    most = _hertz(quick) * (1 + _ROUNDING)
    return [(angle, rpm) for rpm in (near, near + 1) if 1 <= rpm <= _MOST and rpm * unit <= most]


def _said(quick: Project, angle: int, rpm: int) -> Project:
    """The same pulses at another speed, of a motor of this step angle."""
    if angle != quick.step_angle:
        turn = HUNDREDTHS_PER_TURN * quick.microsteps // angle
        count = moved(quick).pulses or 0
        quick = replace(quick, step_angle=angle, turn_distance=turn).with_step(1, distance=count)
    return paced(quick, rpm, None)


def _hertz(project: Project) -> float:
    return execution.frequency(project, project.step(1))


def _stretched(base: Project, seconds: float) -> Project:
    """The same speed with a gentler ramp, so that it takes as long (s) or a little longer; else the gentlest."""
    step = base.step(1)
    low = max(1, int(step.start_frequency * GENTLER))

    def ramp(number: int, start: int) -> Project:
        return base.with_step(1, acceleration=number, start_frequency=start)

    number = _first(1, step.acceleration, lambda one: lasts(ramp(one, low)) < seconds)
    number = number if lasts(ramp(number, low)) >= seconds else max(1, number - 1)
    start = _first(low, step.start_frequency, lambda one: lasts(ramp(number, one)) < seconds)
    return ramp(number, start if lasts(ramp(number, start)) >= seconds else max(low, start - 1))


def _first(low: int, high: int, holds: Callable[[int], bool]) -> int:
    """The lowest of these numbers for which it holds, as it does for all above; `high` where it holds for none."""
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle + 1, high)
    return low


def _number(running: float, steepest: float | None) -> int | None:
    """The number for a ramp up to this frequency (Hz) that is not steeper (Hz/s) in any reading; None: as it is."""
    if steepest is None:
        return None
    return max(1, min(_MOST, int(steepest / max(_steepness(ramp, running) for ramp in _ramps_of_1()))))


def _ramps_of_1() -> list[Ramp]:
    """How the frequency grows with the number 1, by each of the readings."""
    step = Step(acceleration=1)
    usual = execution.USUAL
    return [
        execution.ramp_of(step, execution.Behaviour(**{"ramp_tick_ms": usual.ramp_tick_ms, **reading}))
        for reading in READINGS.values()
    ]


def _steepness(ramp: Ramp, running: float) -> float:
    """Hz/s at its steepest, on the way up to this frequency (Hz)."""
    return ramp.rate * running if ramp.by_pulse else ramp.rate


def _whole_rpm(velocity: float) -> int:
    """The highest speed (RPM) that is not above this velocity (rad/s). Raises RequestError when there is none."""
    exact = velocity / tau * 60
    if exact * (1 + _ROUNDING) >= 1:
        return int(min(exact * (1 + _ROUNDING), _MOST))
    raise RequestError(
        f"{velocity:.6g} rad/s are {exact:.4g} RPM, and speeds are whole RPM",
        expected=f"at least {tau / 60:.4g} rad/s (1 RPM)",
        cause="it must not be faster than that",
        advice="allow more; nothing was sent",
    )
