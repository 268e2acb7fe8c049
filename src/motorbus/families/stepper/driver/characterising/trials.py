"""The experiments themselves: each a project of a few steps that hardly moves, and what is said while it runs.

They move by single pulses or at 1 RPM without a ramp, so that no reading of the acceleration matters to them and a stop
ends them at once. Their times differ by a tenth of a second or more between any two readings, which a slow adapter
does not blur. They come in such an order that what one needs to know has been asked before.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil
from typing import Final

from motorbus.families.stepper.driver.characterising.experiments import SLOW_TURNS, Act, Motor, Trial
from motorbus.families.stepper.table import STEPS, Project, Step

PART: Final = Fraction(3, 5)
"""Of a pulse: cut off it is none, rounded it is one, and carried on it is three for every five."""
_START: Final = Act(0.0, "start_project")


def controls(motor: Motor, scratch: int) -> tuple[Trial, Trial]:
    """Two projects that take what they take in every reading: they tell what is fixed in each time, and the clock."""
    short, long = (
        Trial(
            f"control {delay} ms",
            f"a single pulse and a pause of {delay} ms",
            (),
            (),
            motor.project(scratch, motor.step(1, delay)),
            (_START,),
            motor.turns(1),
        )
        for delay in (300, 1300)
    )
    return short, long


def trials(motor: Motor, scratch: int, empty: int | None) -> tuple[Trial, ...]:
    """All experiments with the clock, in their order; `empty` is a project without steps, when there is one.

    That one is started while the scratch project is selected: a selected project is run as it is edited, so with steps.
    """
    with_scratch = (
        _loops(motor, scratch),
        _rounding(motor, scratch),
        _notice_on_stop(motor, scratch),
        _busy(motor, scratch),
        _motor_stop(motor, scratch),
        _zero_distance(motor, scratch),
    )
    without_steps = () if empty is None else (_cleared(empty),)
    by_hand = _notice_on_once(motor), _stop_scope(motor), _stop_scope_by_notice(motor)
    return (*with_scratch, *without_steps, *by_hand)


def _loops(motor: Motor, scratch: int) -> Trial:
    steps = motor.step(1, 300), motor.step(1, 100, reverse=True)
    return Trial(
        "loops",
        "two steps, the second looped twice, the project twice",
        ("seg_loop", "proj_loop"),
        (),
        motor.project(scratch, *steps, loop_first=2, loop_last=2, loop_count=2, project_loop=2),
        (_START,),
        motor.turns(6),
    )


def _rounding(motor: Motor, scratch: int) -> Trial:
    times = max(4, ceil(motor.slow(0.6)))
    passes = min(254, ceil(times / STEPS))
    count = min(times, STEPS)
    last = motor.step(PART, ceil(300 / passes), rpm=1)
    steps = [motor.step(PART, 0, rpm=1)] * (count - 1)
    looped = passes > 1
    return Trial(
        "rounding",
        f"steps of 3/5 of a pulse at 1 RPM, {count * passes} in all",
        ("rounding",),
        ("proj_loop",) if looped else (),
        motor.project(scratch, *steps, last, project_loop=passes if looped else 0),
        (_START,),
        motor.turns(count * (passes + looped)),
    )


def _notice_on_stop(motor: Motor, scratch: int) -> Trial:
    return Trial(
        "stopped",
        "a pause of 1.5 s, and the project stopped after 0.4 s",
        ("notice_on_stop",),
        (),
        motor.project(scratch, motor.step(1, 1500)),
        (_START, Act(0.4, "stop_project")),
        motor.turns(1),
    )


def _busy(motor: Motor, scratch: int) -> Trial:
    return Trial(
        "started twice",
        "a pause of 1 s, and the project started again after 0.5 s",
        ("busy",),
        (),
        motor.project(scratch, motor.step(1, 1000)),
        (_START, Act(0.5, "start_project")),
        motor.turns(2),
    )


def _motor_stop(motor: Motor, scratch: int) -> Trial:
    pulses = motor.slow(1.5)
    steps = motor.step(pulses, 400, rpm=1), motor.step(1, 300)
    return Trial(
        "motor stopped",
        "a slow move of 1.5 s and another step, and the motor stopped after 0.4 s",
        ("motor_stop_ends_project",),
        ("notice_on_stop",),
        motor.project(scratch, *steps),
        (_START, Act(0.4, "stop_motor")),
        motor.turns(pulses + 1),
    )


def _zero_distance(motor: Motor, scratch: int) -> Trial:
    step = motor.step(0, 300, rpm=1)
    return Trial(
        "distance 0",
        "a step of distance 0 at 1 RPM and a pause of 0.3 s, stopped after 1 s",
        ("zero_distance",),
        ("notice_on_stop",),
        motor.project(scratch, step),
        (_START, Act(1.0, "stop_project")),
        1.5 / 60,
    )


def _notice_on_once(motor: Motor) -> Trial:
    pulses = motor.slow(0.4)
    return Trial(
        "single move",
        "a single move of 0.4 s with the numbers of project 1 as edited for it",
        ("notice_on_once",),
        (),
        motor.project(1, motor.step(pulses, 0, rpm=1, reverse=True)),
        (Act(0.0, "run_once"),),
        motor.turns(pulses),
    )


def _stop_scope(motor: Motor) -> Trial:
    pulses = motor.slow(1.2)
    return Trial(
        "single move stopped",
        "a single move of 1.2 s, the project stopped after 0.3 s, and project 1 started after 0.6 s",
        ("stop_project_scope",),
        ("notice_on_once", "busy", "notice_on_stop"),
        motor.project(1, motor.step(pulses, 100, rpm=1, reverse=True)),
        (Act(0.0, "run_once"), Act(0.3, "stop_project"), Act(0.6, "start_project")),
        motor.turns(2 * pulses),
    )


def _stop_scope_by_notice(motor: Motor) -> Trial:
    """Where a start begins anew whatever runs, only the notice of the move tells that it went on."""
    pulses = motor.slow(1.2)
    return Trial(
        "single move stopped, no start",
        "a single move of 1.2 s, and the project stopped after 0.3 s",
        ("stop_project_scope",),
        ("notice_on_once",),
        motor.project(1, motor.step(pulses, 100, rpm=1, reverse=True)),
        (Act(0.0, "run_once"), Act(0.3, "stop_project")),
        motor.turns(pulses),
        needs=(("notice_on_once", True),),
    )


def _cleared(empty: int) -> Trial:
    return Trial(
        "without steps",
        f"project {empty}, which has no steps, started",
        ("clear_notice",),
        (),
        Project(number=empty),
        (_START,),
        needs=(("zero_distance", "skip"),),
    )


RAMP_STEPS: Final = 4
RAMP_SECONDS: Final = 0.35
"""s that each of them would take at its speed without a ramp, and half of them in reverse."""
_FREQUENCY: Final = 3000
_FASTEST: Final = 240
"""RPM."""


def ramp_speeds(motor: Motor) -> tuple[int, ...]:
    """RPM to time the ramp at, the highest first: about 3 kHz, but 240 at most, its half and its quarter."""
    top = max(1, min(_FASTEST, round(60 * _FREQUENCY / motor.per_turn)))
    return tuple(sorted({top, max(1, top // 2), max(1, top // 4)}, reverse=True))


def ramp(motor: Motor, scratch: int, travel: float, rpm: int, acceleration: int, part: float) -> Project:
    """Forward and back, twice, with ramps from a part of the frequency; not farther than `travel` turns leave it."""
    frequency = motor.frequency(rpm)
    pulses = max(1, min(int(RAMP_SECONDS * frequency), int((travel - SLOW_TURNS) * motor.per_turn)))
    steps = tuple(
        Step(
            distance=pulses * motor.pulse,
            direction=number % 2,
            start_frequency=max(1, int(frequency * part)),
            acceleration=acceleration,
            speed=rpm,
            delay=20,
        )
        for number in range(RAMP_STEPS)
    )
    return motor.project(scratch, *steps)
