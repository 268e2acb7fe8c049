"""Each rule fires where it should, stays quiet where it should, and says why."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given

from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import RULES, Conditions, Finding, lint, net_units
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_B

GOOD = Step(distance=1600, start_frequency=400, acceleration=50, speed=600)
BACK = replace(GOOD, direction=1)
MOTOR = Project(number=2, microsteps=8, step_angle=180, turn_distance=200)


def made(*steps: Step, **values: Any) -> Project:
    return replace(with_steps(MOTOR, steps or (GOOD, BACK)), **values)


def rules(project: Project, **conditions: Any) -> list[str]:
    return [finding.rule for finding in lint(project, Conditions(**conditions))]


def only(rule: str, project: Project, **conditions: Any) -> Finding:
    """The one finding of this rule."""
    found = [finding for finding in lint(project, Conditions(**conditions)) if finding.rule == rule]
    assert len(found) == 1, found
    return found[0]


def test_a_good_project_has_no_findings() -> None:
    assert lint(made()) == []
    assert lint(made(project_loop=5, loop_first=1, loop_last=2, loop_count=3)) == []


def test_dump_b_has_the_two_that_were_reckoned_by_hand() -> None:
    project = decode_image(DUMP_B[6:])
    walk, lost = lint(project)
    assert (walk.rule, walk.step) == ("L11", 0)
    assert "-16078 units in each pass, -3.2156 turns; -48234 units after 3 passes" in walk.text
    assert (lost.rule, lost.step) == ("L3", 2)
    assert "0.92 lost each time, 1.84 lost in a pass, 5.52 lost in all" in lost.text


@pytest.mark.parametrize(
    ("rule", "step", "project", "text"),
    [
        ("L1", 0, made(turn_distance=0), "turn_distance is 0"),
        ("L2", 0, made(step_angle=70, microsteps=7, turn_distance=9), "3600 pulses a turn, which is whole"),
        ("L2", 0, made(step_angle=7), "41142.9 pulses a turn"),
        ("L3", 1, made(replace(GOOD, distance=1), turn_distance=3), "533.333 pulses, 0.333 lost each time"),
        ("L5", 1, made(replace(GOOD, start_frequency=0)), "start 0 Hz, running 16000 Hz"),
        ("L5", 2, made(GOOD, replace(BACK, start_frequency=16000)), "start 16000 Hz"),
        ("L6", 1, made(replace(GOOD, acceleration=0)), "acceleration 0"),
        ("L7", 1, made(replace(GOOD, distance=100)), "rpm at most, 600 rpm wanted"),
        ("L8", 1, made(Step()), "nothing at all"),
        ("L8", 1, made(Step(start_input=1)), "only a wait"),
        ("L9", 0, made(loop_first=1, loop_last=3, loop_count=2), "1 to 3 of 2 are no range"),
        ("L9", 0, made(loop_first=1, loop_last=2, loop_count=1), "run once, as without a loop"),
        ("L9", 0, made(loop_first=1, loop_last=2, loop_count=0), "count 0 run once"),
        ("L9", 0, made(loop_first=1, loop_last=2, loop_count=255), "255 is not defined"),
        ("L9", 0, made(loop_count=2), "count 2 without a range"),
        ("L10", 0, made(project_loop=255), "the project loop is 255"),
        ("L11", 0, made(GOOD, project_loop=255), "+1600 units in each pass, 8 turns"),
        ("L12", 1, made(replace(GOOD, start_input=3)), "start input 3"),
        ("L12", 1, made(replace(GOOD, stop_input=6)), "stop input 6"),
        ("L13", 1, made(replace(GOOD, stop_input=5), power_on_home=1), "as stop input"),
        ("L14", 1, made(replace(GOOD, start_input=2, stop_input=2)), "input 2"),
        ("L15", 0, made(replace(GOOD, output=2)), "output 2"),
        ("L15", 0, made(replace(GOOD, output=4), replace(BACK, output=5)), "output 2, 3"),
        ("L17", 0, made(power_on_home=1), "in reverse until input 5"),
        ("L5", 1, made(replace(GOOD, speed=0), project_loop=3), "speed 0: the motor does not turn"),
        ("L19", 1, made(replace(GOOD, delay=3_600_001)), "3600.001 s, more than 3600 s"),
        ("L19", 1, made(replace(GOOD, delay=0xFFFFFF)), "16777.215 s, the most that can be said (raw 16777215"),
        ("L19", 0, made(replace(GOOD, delay=3_600_000), project_loop=9), "32400 s of pauses in all, more than 28800"),
        ("L19", 0, made(replace(GOOD, delay=3_600_000), loop_first=1, loop_last=1, loop_count=9, project_loop=255),
         "32400 s of pauses in each pass"),
        ("L20", 0, made().with_step(7, delay=1), "step 7"),
        ("L20", 0, made().with_step(7, output=9), "step 7; step 7, output: 9 is not possible (0 to 8)"),
        ("L21", 0, made(mode4=2), "variant 2"),
    ],
)  # fmt: skip
def test_a_rule_fires(rule: str, step: int, project: Project, text: str) -> None:
    found = only(rule, project)
    assert found.step == step
    assert text in found.text


def test_rules_that_depend_on_conditions() -> None:
    assert rules(made(), highest=10_000) == ["L4", "L4"]
    assert "600 rpm are 16000 Hz, more than 10000 Hz" in lint(made(), Conditions(highest=10_000))[0].text
    waiting = made(replace(GOOD, start_input=1), BACK)
    assert rules(waiting) == []
    assert rules(waiting, unattended=True) == ["L22"]
    homed = made(replace(GOOD, start_input=5), BACK)
    assert rules(homed) == []
    assert rules(homed, homing=True) == ["L13"]
    assert rules(made(replace(GOOD, delay=2000)), longest=1.0) == ["L19"]
    assert rules(made(replace(GOOD, delay=2000), replace(BACK, delay=1000)), longest_total=3.0) == []
    assert rules(made(replace(GOOD, delay=2000), replace(BACK, delay=1001)), longest_total=3.0) == ["L19"]
    assert rules(made(replace(GOOD, delay=0xFFFFFF)), longest=1e6) == ["L19"]


def test_what_jog_depends_on() -> None:
    one = made(number=1)
    assert rules(one, before=one) == rules(one, before=one.with_step(2, speed=1).with_step(1, delay=7)) == []
    assert rules(made()) == rules(made(), before=one.with_step(1, speed=1)) == []  # another project
    found = only("L16", one, before=replace(one.with_step(1, speed=1, delay=7), microsteps=4))
    assert (found.step, found.text) == (1, "speed 1 becomes 600, microsteps 4 becomes 8")
    untold = only("L16", one)
    assert (untold.step, untold.level) == (1, "note")
    assert untold.text.startswith("from now on they go at 600 rpm, from 400 Hz on by 50 Hz; ")


def test_bytes_that_nobody_knows() -> None:
    image = bytes(12) + b"\x07" + bytes(207)
    found = only("L18", made(), image=image)
    assert found.text == "07 at byte 18 of the dump"
    assert rules(made(), image=bytes(220)) == []


def test_a_motor_that_is_told_otherwise() -> None:
    found = only("L23", made(), motor="48 full steps are stored as 1.8 deg")
    assert (found.step, found.level, found.text) == (0, "note", "48 full steps are stored as 1.8 deg")


def test_other_readings_change_what_is_found() -> None:
    left_on = made(replace(GOOD, output=1), BACK)
    assert rules(left_on) == ["L15"]
    assert rules(left_on, how=Behaviour(outputs_on_stop="off")) == []
    assert rules(left_on, how=Behaviour(output_zero="off")) == []
    broken = made(replace(GOOD, distance=1), turn_distance=3)
    assert "too many" not in only("L3", broken, how=Behaviour(rounding="nearest")).text
    carried = only("L3", broken, how=Behaviour(rounding="carry")).text
    assert carried == "533.333 pulses, the rest of less than one is carried on to the next step"
    assert only("L3", broken).text == "533.333 pulses, 0.333 lost each time"
    for word in ("lost", "carried", "rounded"):
        assert word not in RULES["L3"].reason, "which of them it is depends on the reading"
    up = made(replace(GOOD, distance=2), turn_distance=3)
    assert "0.333 too many each time" in only("L3", up, how=Behaviour(rounding="nearest")).text
    once = made(GOOD, project_loop=0)
    assert rules(once) == []
    assert rules(replace(once, project_loop=1), how=Behaviour(proj_loop="extra")) == ["L11"]


def test_net_displacement_counts_the_loop() -> None:
    assert net_units(made(GOOD, BACK, BACK, loop_first=2, loop_last=3, loop_count=4)) == 1600 - 8 * 1600
    assert net_units(Project()) == 0


def test_what_moves_nothing_goes_nowhere() -> None:
    still = made(replace(GOOD, speed=0), project_loop=3)
    assert net_units(still) == 0
    assert rules(still) == ["L5"]
    assert "L3" not in rules(made(replace(GOOD, distance=1, speed=0), turn_distance=3000))
    less = made(replace(GOOD, distance=1), turn_distance=2000, project_loop=3)  # 0.8 pulses
    assert [net_units(less, Behaviour(rounding=rounding)) for rounding in ("trunc", "nearest", "carry")] == [
        0,
        1,
        1,
    ]


def test_without_a_geometry_nothing_is_said_of_its_frequencies() -> None:
    assert rules(made(turn_distance=0)) == ["L1"]


def test_every_rule_says_how_grave_and_why() -> None:
    assert list(RULES) == [f"L{number}" for number in range(1, 24)]
    assert {rule.level for rule in RULES.values()} == {"error", "warning", "note"}
    assert all(rule.title and rule.reason for rule in RULES.values())
    found = Finding("L10", 3, "for ever")
    assert (found.level, found.reason) == ("note", RULES["L10"].reason)
    assert str(found) == f"L10 note: step 3: endless: for ever ({RULES['L10'].reason})"


@given(projects())
def test_whatever_can_be_said_can_be_judged(project: Project) -> None:
    for finding in lint(project, Conditions(unattended=True, homing=True)):
        assert finding.rule in RULES
        assert 0 <= finding.step <= project.total_steps
        assert "\n" not in str(finding)


def test_a_cleared_project_can_be_judged() -> None:
    assert rules(Project()) == rules(Project(number=3)) == ["L1"]
    assert "cleared" in only("L1", Project()).text
    assert rules(Project(number=3, total_steps=1).with_step(1, delay=5)) == ["L1", "L1", "L1"]
