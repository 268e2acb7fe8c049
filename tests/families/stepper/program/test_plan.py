"""The plan against what was reckoned by hand, against the machine, and as data."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import assume, given

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import Estimate, duration, estimate, plan
from motorbus.families.stepper.table import Project, decode_image
from tests.families.stepper.program.projects import projects
from tests.families.stepper.vectors import DUMP_A, DUMP_B

B = decode_image(DUMP_B[6:])
A = decode_image(DUMP_A[6:])


def test_dump_b_is_estimated_as_reckoned() -> None:
    found = estimate(B)
    assert found.seconds == pytest.approx(41.613525, abs=1e-6)
    assert (found.waits, found.cuts, found.endless) == (6, 6, False)
    assert str(found).startswith("at least 41.6 s + 6 waits (38.9 s to 75.6 s")
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
    assert str(estimate(still, how)) == "at least for ever"
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


@given(projects())
def test_a_plan_is_what_the_machine_does(project: Project) -> None:
    assume(not project.is_endless)
    short = replace(project, project_loop=min(project.project_loop, 2), loop_count=min(project.loop_count, 3))
    free = replace(short, steps=tuple(replace(step, stop_input=0) for step in short.steps))
    found = plan(free)
    state = execution.power_on(0.0, inputs=frozenset({1, 2, 5})).state
    done = execution.advance(execution.start(state, free, 0.0).state, 1e12)
    moment = next(one.at for one in done.told if one.kind == "ended") if done.told else 0.0
    assert moment == pytest.approx(found.estimate.seconds, rel=1e-9, abs=1e-9)
    pulses = sum(
        free.step(step.number).sign * step.sent * step.times for step in found.steps if step.frequency
    )
    assert done.state.base == pulses * (found.passes or 1)
