"""The course of a study: what is tried, how often, and what a bad line spoils."""

from __future__ import annotations

from dataclasses import fields

import pytest

from motorbus.families.stepper.driver.characterising.study import (
    IN_SILENCE,
    RAMP,
    REPETITIONS,
    Experiment,
    ramp_experiment,
    studied,
)
from motorbus.families.stepper.program import Profile
from motorbus.families.stepper.simulator import Switches
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.driver.characterising.studies import case_of

TIMED = {"ramp", "rounding", "zero_distance", "seg_loop", "proj_loop", "busy", "notice_on_stop"}


def study(there: Bench) -> Profile:
    return there.run(studied(case_of(there)))


def starts(there: Bench, project: int) -> int:
    return sum(one.startswith(f"FF AA 4E {project:02X}") for one in there.sent())


def test_all_that_can_be_told_of_a_usual_controller_is_told() -> None:
    with bench() as there:
        profile = study(there)
        usual = {one.name: one.default for one in fields(Switches)}
        for name, value in profile.settled.items():
            expected = pytest.approx(usual[name], rel=0.05) if name == "ramp_tick_ms" else usual[name]
            assert value == expected
        assert len(profile.settled) == 16
        assert not TIMED & set(profile.open)


def test_each_experiment_is_told_before_it_is_tried() -> None:
    with bench() as there:
        study(there)
        told = [one for one in there.events if isinstance(one, Experiment)]
        assert told[0].name == "edits"
        assert told[-1] == ramp_experiment(1.0)
        assert told[-1].settles == RAMP
        names = [one.name for one in told]
        assert len(set(names)) == len(names)


def test_what_rests_on_silence_is_tried_once_more() -> None:
    """Where a stop has its notice, two experiments rest on that and not on silence."""
    with bench() as there:
        study(there)
        usual = starts(there, 4)
    with bench(notice_on_stop=True) as there:
        study(there)
        assert usual - starts(there, 4) == 2 * (IN_SILENCE - REPETITIONS)


def test_a_project_without_steps_is_not_started_where_distance_0_may_be_endless() -> None:
    with bench(zero_distance="endless") as there:
        profile = study(there)
        assert "tried only where zero_distance is skip" in profile.open["clear_notice"]
        assert starts(there, 2) == 0


def test_a_line_that_fails_spoils_experiments_and_makes_no_answer_wrong() -> None:
    usual = {one.name: one.default for one in fields(Switches)}
    with bench(reply_fault="lost", fault_every=11) as there:
        case = case_of(there)
        profile = there.run(studied(case))
        assert case.found.doubts
        assert len(profile.settled) < 16
        assert all(profile.settled[name] == usual[name] for name in profile.settled if name != "ramp_tick_ms")
