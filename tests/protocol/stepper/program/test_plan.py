"""The plan against what was reckoned by hand, against the machine, and as data."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import assume, given

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import Estimate, duration, estimate, plan
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

B = decode_image(DUMP_B[6:])
A = decode_image(DUMP_A[6:])


def test_dump_b_is_estimated_as_reckoned() -> None:
    found = estimate(B)
    assert found.seconds == pytest.approx(41.613525, abs=1e-6)
    assert (found.waits, found.cuts, found.endless) == (6, 6, False)
    assert str(found).startswith("at least 41.6 s + 6 waits; 38.9 s to 75.6 s if the acceleration is")
    assert plan(B).pass_seconds == pytest.approx(13.871175, abs=1e-6)


def test_the_band_is_that_of_the_readings() -> None:
    found = estimate(A)
    assert set(found.readings) == {"per pulse", "per 1 ms", "per 10 ms"}
    assert found.readings["per pulse"] == pytest.approx(1.821250, abs=1e-6)
    assert found.readings["per 1 ms"] == pytest.approx(1.685587, abs=1e-6)
    assert found.readings["per 10 ms"] == pytest.approx(2.428, abs=1e-3)
    assert (found.low, found.high) == (min(found.readings.values()), max(found.readings.values()))
    fitted = estimate(A, Behaviour(ramp_tick_ms=100.0))
    assert fitted.seconds == fitted.high == pytest.approx(5.297, abs=1e-3)


def test_each_step_is_told() -> None:
    found = plan(B, name="B")
    assert found.order == (1, 2, 3, 2, 3)
    assert (found.passes, found.net_units) == (3, -16078)
    assert [step.sent for step in found.steps] == [12800, 72721, 56032]
    assert [round(float(step.exact), 2) for step in found.steps] == [12800.0, 72721.92, 56032.0]
    assert [step.motion for step in found.steps] == pytest.approx([2.060062, 2.588544, 2.067013], abs=1e-6)
    assert [step.times for step in found.steps] == [1, 2, 2]
    assert {step.shape for step in found.steps} == {"trapezoid"}
    assert [step.frequency for step in found.steps] == [6400, 32000, 32000]


def test_the_plan_is_json() -> None:
    data = json.loads(plan(B, name="B").json())
    assert data["schema"] == "motorbus.stepper.plan/1"
    assert (data["name"], data["project"], data["passes"]) == ("B", 2, 3)
    assert data["net_turns_per_pass"] == pytest.approx(-3.2156)
    assert data["estimate"]["waits"] == 6
    assert data["estimate"]["text"] == str(estimate(B))
    second = data["steps"][1]
    assert (second["wait_for_input"], second["stop_on_input"], second["output"]) == (1, None, "output 1 off")
    assert second["pulses"] == 72721
    cleared = json.loads(plan(Project()).json())
    assert (cleared["order"], cleared["net_turns_per_pass"], cleared["steps"]) == ([], None, [])


def test_an_endless_project_is_estimated_by_the_pass() -> None:
    found = estimate(replace(B, project_loop=255))
    assert found.seconds == pytest.approx(13.871175, abs=1e-6)
    assert str(found).startswith("at least 13.9 s + 2 waits for each pass, without an end")
    assert plan(replace(B, project_loop=255)).passes is None


def test_a_step_that_never_ends_is_for_ever() -> None:
    still = A.with_step(1, distance=0)
    how = Behaviour(zero_distance="endless")
    assert str(estimate(still, how)) == "never ends: step 1"
    assert estimate(still, how).data()["never_ends_at_step"] == 1
    assert estimate(still).data()["never_ends_at_step"] is None
    second = with_steps(A, (A.step(1), replace(still.step(1), stop_input=2)))
    assert str(estimate(second, how)) == "never ends: step 2, unless a stop input ends it"
    assert json.loads(plan(still, how).json())["steps"][0]["motion_seconds"] is None
    assert estimate(still).seconds == 1.0


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (Estimate(seconds=1.0, waits=0, cuts=0, endless=False, readings={"x": 1.0}), "at least 1.0 s"),
        (Estimate(seconds=1.0, waits=1, cuts=1, endless=False, readings={"x": 1.0}),
         "at least 1.0 s + 1 wait; less where a stop input ends a step early, once at most"),
    ],
)  # fmt: skip
def test_an_estimate_is_said_in_words(found: Estimate, text: str) -> None:
    assert str(found) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.04, "0.0 s"),
        (41.61, "41.6 s"),
        (99.94, "99.9 s"),
        (99.96, "1 min 40 s"),
        (252.4, "4 min 12 s"),
        (7500, "2 h 5 min"),
        (1e9, "277777 h 46 min"),
    ],
)
def test_a_time_for_people(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.mark.parametrize("rounding", ["trunc", "nearest", "carry"])
@given(projects())
def test_a_plan_is_what_the_machine_does(rounding: str, project: Project) -> None:
    assume(not project.is_endless)
    short = replace(project, project_loop=min(project.project_loop, 2), loop_count=min(project.loop_count, 3))
    free = replace(short, steps=tuple(replace(step, stop_input=0) for step in short.steps))
    how = Behaviour(rounding=rounding)
    found = plan(free, how)
    state = execution.power_on(0.0, how, inputs=frozenset({1, 2, 5})).state
    done = execution.advance(execution.start(state, free, 0.0).state, 1e12)
    moment = next(one.at for one in done.told if one.kind == "ended") if done.told else 0.0
    assert moment == pytest.approx(found.estimate.seconds, rel=1e-9, abs=1e-9)
    assert done.state.base == sum(
        free.step(step.number).sign * sent * times
        for step in found.steps
        for sent, times in step.runs.items()
    )
    for step in found.steps:
        assert sum(step.runs.values()) == step.times * (found.passes or 1)


CARRY = Behaviour(rounding="carry")


def test_carried_pulses_are_in_the_estimate() -> None:
    """A third of a pulse in each of 300 passes: the machine sends one in three, and so says the estimate."""
    third = Step(distance=1, speed=60, start_frequency=1)
    project = Project(
        number=1,
        total_steps=1,
        microsteps=1,
        step_angle=180,
        turn_distance=600,
        project_loop=254,
        steps=(third,) * 10,
    )
    found = plan(project, CARRY)
    (step,) = found.steps
    assert (step.runs, step.sent) == ({0: 254 - 84, 1: 84}, 1)
    assert found.estimate.seconds == pytest.approx(84 / 200)
    assert found.pass_seconds == pytest.approx(84 / 200 / 254)
    assert found.data()["steps"][0] | {"pulses": 1, "pulses_at_least": 0} == found.data()["steps"][0]
    assert estimate(project).seconds == 0


def test_only_a_motion_can_be_cut_short() -> None:
    third = Step(distance=1, speed=60, start_frequency=1, stop_input=1)
    project = Project(
        number=1,
        total_steps=1,
        microsteps=1,
        step_angle=180,
        turn_distance=600,
        project_loop=6,
        steps=(third,) * 10,
    )
    assert (estimate(project).cuts, estimate(project, CARRY).cuts) == (0, 2)
    endless = Behaviour(zero_distance="endless")
    assert estimate(project.with_step(1, distance=0), endless).cuts == 6


def test_a_step_at_speed_0_sends_nothing_and_leaves_what_is_carried() -> None:
    third = Step(distance=1, speed=60, start_frequency=1)
    still = replace(third, speed=0)
    project = Project(
        number=1,
        total_steps=4,
        microsteps=1,
        step_angle=180,
        turn_distance=600,
        steps=(third, still, third, third) * 3,
    )
    assert [step.runs for step in plan(project, CARRY).steps] == [{0: 1}, {0: 1}, {0: 1}, {1: 1}]
    assert [step.sent for step in plan(project.with_step(2, distance=600)).steps] == [0, 0, 0, 0]
