"""Each rule finds what it is for, and nothing in a good project; estimates and reach of known projects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given

from motorbus.families.stepper.parameters import Project, Step, decode_image, with_steps
from motorbus.families.stepper.program.estimate import estimate, net_units, reach
from motorbus.families.stepper.program.lint import RULES, lint
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

GOOD = Step(distance=1600, start_frequency=400, acceleration=50, speed=600)
BACK = replace(GOOD, direction=1)
MOTOR = Project(number=2, microsteps=8, step_angle=180, turn_distance=200)
A, B = decode_image(DUMP_A[6:]), decode_image(DUMP_B[6:])


def made(*steps: Step, **values: Any) -> Project:
    return replace(with_steps(MOTOR, steps or (GOOD, BACK)), **values)


def test_a_good_project_has_no_findings() -> None:
    assert lint(made()) == []
    assert lint(made(project_loop=5, loop_first=1, loop_last=2, loop_count=3)) == []


def test_dump_b_has_the_two_findings_that_were_computed_by_hand() -> None:
    walk, lost = lint(B)
    assert (walk.rule, walk.step, walk.level) == ("L11", 0, "warning")
    assert walk.text == "-16078 units in each pass, -48234 after 3 passes"
    assert str(lost).startswith("L3 warning: step 2: 72721.9 pulses, 5.52 lost in 6 executions (")


@pytest.mark.parametrize(
    ("rule", "step", "project", "text"),
    [
        ("L1", 0, Project(number=3), "the project has no steps"),
        ("L1", 0, made(turn_distance=0), "turn_distance is 0"),
        ("L3", 1, made(replace(GOOD, distance=1), turn_distance=3), "533.333 pulses, 0.333 lost"),
        ("L5", 1, made(replace(GOOD, start_frequency=0)), "start 0 Hz, running 16000 Hz"),
        ("L5", 2, made(GOOD, replace(BACK, start_frequency=16000)), "start 16000 Hz"),
        ("L5", 1, made(replace(GOOD, speed=0)), "speed 0"),
        ("L2", 0, made(loop_first=2, loop_last=1, loop_count=2), "2 to 1 is no range"),
        ("L4", 1, made(replace(GOOD, speed=6000), BACK), "160000 Hz, more than 100000 Hz"),
        ("L6", 1, made(replace(GOOD, acceleration=0)), "acceleration 0"),
        ("L7", 1, made(replace(GOOD, distance=100)), "rpm at most, 600 rpm wanted"),
        ("L8", 1, made(Step()), "nothing at all"),
        ("L8", 1, made(Step(start_input=1)), "only a wait"),
        ("L9", 0, made(loop_first=1, loop_last=3, loop_count=2), "steps 1 to 3 of 2, count 2"),
        ("L9", 0, made(loop_first=1, loop_last=2, loop_count=1), "run once"),
        ("L9", 0, made(loop_count=2), "count 2"),
        ("L10", 0, made(project_loop=255), "255"),
        ("L11", 0, made(GOOD, project_loop=255), "+1600 units in each pass"),
        ("L12", 1, made(replace(GOOD, start_input=3)), "input 3"),
        ("L13", 1, made(replace(GOOD, stop_input=5), power_on_home=1), "input 5"),
        ("L14", 1, made(replace(GOOD, start_input=2, stop_input=2)), "input 2"),
        ("L15", 0, made(replace(GOOD, output=4), replace(BACK, output=5)), "output 2, 3"),
        ("L16", 0, made(number=1), "600 rpm, from 400 Hz by 50 Hz"),
        ("L17", 0, made(power_on_home=1), "in reverse until input 5"),
        ("L19", 1, made(replace(GOOD, delay=3_600_001)), "3600.001 s"),
        ("L19", 1, made(replace(GOOD, delay=0xFFFFFF)), "16777.215 s"),
        ("L19", 0, made(replace(GOOD, delay=3_600_000), project_loop=9), "32400 s of pauses"),
        ("L21", 0, made(mode4=2), "mode 4 is 2"),
    ],
)  # fmt: skip
def test_a_rule_finds_it(rule: str, step: int, project: Project, text: str) -> None:
    (found,) = [one for one in lint(project) if one.rule == rule]
    assert found.step == step
    assert text in found.text


@given(projects())
def test_any_project_is_judged_and_estimated(project: Project) -> None:
    for finding in lint(project):
        assert finding.rule in RULES
        assert "\n" not in str(finding)
    found = estimate(project)
    assert found.seconds >= 0
    low, high = reach(project)
    assert low <= 0 <= high


# -- duration and distance -----------------------------------------------------------------------------


def test_dump_b_is_estimated_as_computed_by_hand() -> None:
    found = estimate(B)
    assert found.seconds == pytest.approx(41.613525, abs=1e-6)
    assert (found.waits, found.cuts, found.endless) == (6, 6, False)
    assert str(found).startswith("about 41.6 s + 6 waits for an input; less")
    assert "up to 6 times" in str(found)
    endless = estimate(replace(B, project_loop=255))
    assert endless.seconds == pytest.approx(13.871175, abs=1e-6)
    assert "for each pass, endless" in str(endless)


def test_the_estimate_follows_the_tick_of_the_ramp() -> None:
    assert estimate(A).seconds == pytest.approx(1.685587, abs=1e-6)
    assert estimate(A, 10.0).seconds == pytest.approx(2.428, abs=1e-3)


def test_net_displacement_counts_the_loop_and_what_moves() -> None:
    assert net_units(made(GOOD, BACK, BACK, loop_first=2, loop_last=3, loop_count=4)) == 1600 - 8 * 1600
    assert net_units(made(replace(GOOD, speed=0))) == 0
    assert net_units(made(replace(GOOD, distance=1), turn_distance=2000)) == 0  # 0.8 pulses


@pytest.mark.parametrize(
    ("project", "ends"),
    [
        (made(), (0, 1600)),
        (made(GOOD, project_loop=3), (0, 4 * 1600)),  # 3 may count repetitions
        (made(BACK, project_loop=255), (-1_000_001 * 1600, 0)),
        (made(GOOD, BACK, BACK, loop_first=2, loop_last=3, loop_count=2), (-5 * 1600, 1600)),
        (made(replace(GOOD, speed=0)), (0, 0)),
    ],
)
def test_the_farthest_ends_in_both_readings_of_the_loops(project: Project, ends: tuple[int, int]) -> None:
    assert reach(project) == ends
