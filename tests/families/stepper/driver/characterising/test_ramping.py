"""The ramp of a controller is timed, and what cannot be told from the times is left open."""

from __future__ import annotations

from dataclasses import replace

import pytest

from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.driver.characterising.ramping import ramped
from motorbus.families.stepper.driver.characterising.timing import controlled
from motorbus.families.stepper.table import Project, Step, with_steps
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.driver.characterising.studies import case_of

MOTOR = with_steps(Project(microsteps=8, step_angle=180, turn_distance=1600), (Step(distance=1, speed=60),))


def timed(there: Bench, project: Project = MOTOR) -> Case:
    there.simulated.put(1, project)
    case = case_of(there)
    timing = there.run(controlled(case))
    assert timing is not None
    there.run(ramped(case, timing))
    return case


@pytest.mark.parametrize("tick", [0.05, 0.3, 1.0, 10.0, 100.0, 5000.0])
def test_the_tick_is_found(tick: float) -> None:
    with bench(ramp_tick_ms=tick, turnaround=0.013) as there:
        case = timed(there)
        assert case.found.known["ramp"] == "time"
        assert case.found.known["ramp_tick_ms"] == pytest.approx(tick, rel=0.05)
        assert case.found.measured["tick_ms"] == case.found.known["ramp_tick_ms"]


@pytest.mark.parametrize(("microsteps", "angle"), [(1, 180), (8, 180), (32, 90), (256, 180), (10, 7)])
@pytest.mark.parametrize("ramp", ["time", "pulse"])
def test_either_reading_is_found_with_any_motor(microsteps: int, angle: int, ramp: str) -> None:
    with bench(ramp=ramp) as there:
        case = timed(there, replace(MOTOR, microsteps=microsteps, step_angle=angle))
        assert case.found.known["ramp"] == ramp
        if ramp == "time":
            assert case.found.known["ramp_tick_ms"] == pytest.approx(1.0, rel=0.05)
        else:
            assert "no tick" in case.found.profile().open["ramp_tick_ms"]


def test_a_ramp_that_is_over_at_once_is_left_open() -> None:
    with bench(ramp_tick_ms=0.001) as there:
        case = timed(there)
        assert "ramp" not in case.found.known
        assert "too little to be timed" in case.found.profile().open["ramp_tick_ms"]


def test_moves_whose_notices_are_lost_or_late_leave_it_open() -> None:
    for fault, says in (("lost", "was not seen to begin and to end"), ("late", "ramp")):
        with bench(fault_every=2, fault_time=0.3) as there:
            case = case_of(there)
            timing = there.run(controlled(case))
            assert timing is not None
            there.simulated.switch(notice_fault=fault)
            there.run(ramped(case, timing))
            assert not {"ramp", "ramp_tick_ms"} & set(case.found.known)
            assert case.found.doubts
            assert says in case.found.profile().open["ramp"] or fault == "late"


def test_the_motor_comes_back_and_never_goes_farther_than_it_may() -> None:
    with bench() as there:
        timed(there)
        assert abs(there.simulated.position) <= 4  # what the controls have moved it
