"""What an experiment would show in each reading is played, and an answer is given only where one is left."""

from __future__ import annotations

from fractions import Fraction

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.driver.characterising.experiments import Act, Motor, Seen, Trial, judged
from motorbus.families.stepper.driver.characterising.trials import trials
from motorbus.families.stepper.table import Project

MOTOR = Motor.of(Project(microsteps=8, step_angle=180))
BY_NAME = {one.name: one for one in trials(MOTOR, 4, 3)}
STARTED = ((0.0,), (0.0,))


def seen(trial: Trial, **way: str | bool) -> Seen:
    """What a controller of this reading shows of it."""
    whole = next(one for one in trial.ways(way))
    return trial.played(whole, tuple(act.at for act in trial.acts))


def verdict(name: str, known: dict[str, str | bool | float], *shown: Seen) -> dict[str, object]:
    trial = BY_NAME[name]
    at = tuple(act.at for act in trial.acts)
    found = judged(trial, known, [(at, one) for one in shown])
    return {"answers": dict(found.answers), "silent": found.silent, "fits": found.fits}


def test_a_notice_at_its_moment_is_an_answer() -> None:
    loops = seen(BY_NAME["loops"], seg_loop="extra", proj_loop="total")
    assert loops.ends == pytest.approx((1.2,), abs=0.02)
    assert verdict("loops", {}, loops, loops) == {
        "answers": {"seg_loop": "extra", "proj_loop": "total"},
        "silent": False,
        "fits": True,
    }


def test_repetitions_that_differ_are_no_answer() -> None:
    one = seen(BY_NAME["loops"], seg_loop="extra", proj_loop="total")
    other = seen(BY_NAME["loops"], seg_loop="total", proj_loop="total")
    assert verdict("loops", {}, one, other) == {"answers": {}, "silent": False, "fits": False}


def test_a_notice_at_another_moment_is_no_answer() -> None:
    found = verdict("loops", {}, Seen((True,), (1.35,)))
    assert (found["answers"], found["fits"]) == ({}, False)


def test_what_does_not_come_is_an_answer_that_rests_on_silence() -> None:
    assert verdict("stopped", {}, Seen((True, True), ())) == {
        "answers": {"notice_on_stop": False},
        "silent": True,
        "fits": True,
    }
    assert verdict("stopped", {}, Seen((True, True), (0.41,)))["silent"] is False


def test_an_answer_that_depends_on_another_question_waits_for_it() -> None:
    """Where a start begins anew, it does so whether or not the move before it was stopped."""
    shown = Seen((True, True, True), (1.9,))
    name = "single move stopped"
    assert verdict(name, {"busy": "restart"}, shown)["answers"] == {}
    assert verdict(name, {}, shown)["answers"] == {}
    assert verdict(name, {"busy": "ignore"}, shown)["answers"] == {"stop_project_scope": "all"}


@pytest.mark.parametrize("busy", ["ignore", "silent", "restart"])
def test_a_second_start_tells_all_three_readings(busy: str) -> None:
    shown = seen(BY_NAME["started twice"], busy=busy)
    found = verdict("started twice", {}, shown, shown)
    assert found["answers"] == {"busy": busy}
    assert found["silent"] is (busy == "silent")


def test_a_trial_says_how_long_it_may_take_and_how_many_notices_may_come() -> None:
    loops = BY_NAME["loops"]
    assert loops.longest({}) == pytest.approx(1.8, abs=0.05)
    assert loops.longest({"seg_loop": "total", "proj_loop": "total"}) == pytest.approx(1.0, abs=0.05)
    assert loops.most({}) == 1
    still = Trial("nothing", "", (), (), Project(number=4), (Act(0.0, "stop_motor"),))
    assert (still.longest({}), still.most({})) == (0.0, 0)


def test_the_evidence_says_what_was_seen_and_what_would_have_been() -> None:
    trial = BY_NAME["stopped"]
    at = (0.0, 0.4)
    told = judged(trial, {}, [(at, Seen((True, True), ()))]).why
    assert told == "seen once: no notice; otherwise a notice after 0.40 s"
    odd = judged(trial, {}, [(at, Seen((True, False), (3.0,)))] * 2).why
    assert odd.startswith(
        "seen 2 times: a notice after 3.00 s, and one command not answered; none of the readings"
    )


@pytest.mark.parametrize(
    "project",
    [
        Project(number=2),
        Project(number=2, microsteps=1, step_angle=0),
        Project(number=2, microsteps=65535, step_angle=7),
    ],
)
def test_a_motor_that_cannot_be_told_in_fifths_of_a_pulse_is_refused(project: Project) -> None:
    with pytest.raises(RequestError, match="project 2: .* pulses for a turn"):
        Motor.of(project)


@pytest.mark.parametrize("angle", [180, 90, 7, 250])
def test_a_step_has_the_pulses_that_were_asked_for(angle: int) -> None:
    motor = Motor.of(Project(microsteps=16, step_angle=angle))
    project = motor.project(3, motor.step(7, 0), motor.step(Fraction(3, 5), 0))
    unit = project.pulses_per_unit
    assert unit is not None
    assert [step.distance * unit for step in project.steps[:2]] == [7, Fraction(3, 5)]
    assert project.step(1).start_frequency >= motor.frequency(project.step(1).speed)
