"""The two codings of the outputs, which agree on 1 to 3 and on nothing else; projects as numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest

from motorbus.families.stepper import table
from motorbus.families.stepper.table import OutputPort, Project, Step, StepOutput


@pytest.mark.parametrize(
    ("action", "before", "after"),
    [
        (0, 0b101, 0b101),
        (1, 0b000, 0b001),
        (2, 0b000, 0b010),
        (3, 0b001, 0b101),
        (4, 0b000, 0b111),
        (5, 0b111, 0b110),
        (6, 0b111, 0b101),
        (7, 0b111, 0b011),
        (8, 0b111, 0b000),
        (9, 0b010, 0b010),
    ],
)
def test_what_the_action_of_a_step_does(action: int, before: int, after: int) -> None:
    assert table.after_step(before, action) == after
    assert table.after_step(before, action, zero_is_off=True) == (after if action else 0)


@pytest.mark.parametrize(
    ("port", "level", "before", "after"),
    [
        (1, 1, 0b000, 0b001),
        (1, 0, 0b111, 0b110),
        (3, 1, 0b000, 0b100),
        (4, 1, 0b000, 0b111),
        (4, 0, 0b111, 0b000),
        (5, 1, 0b000, 0b000),
        (5, 0, 0b111, 0b111),
    ],
)
def test_what_set_output_does(port: int, level: int, before: int, after: int) -> None:
    assert table.after_port(before, port, level) == after


def test_four_and_five_are_other_things_in_a_step_and_in_the_command() -> None:
    assert (StepOutput.ALL_ON, StepOutput.OFF_1) == (4, 5)
    assert (OutputPort.ALL, OutputPort.LEDS) == (4, 5)
    assert table.after_step(0b111, 5) != table.after_port(0b111, 5, 1)


@pytest.mark.parametrize("output", [0, 1, 2, 3])
@pytest.mark.parametrize("on", [True, False])
def test_an_action_is_found_by_output_and_level(output: int, on: bool) -> None:
    action = table.step_output_of(output, on)
    wanted = table.ALL if not output else 1 << output - 1
    assert table.after_step(0 if on else table.ALL, action) == (wanted if on else table.ALL & ~wanted)


def test_pulses_of_a_turn_and_of_a_unit_are_exact() -> None:
    project = Project(microsteps=8, step_angle=180, turn_distance=5000)
    assert project.pulses_per_turn == 1600
    assert project.pulses_per_unit == Fraction(8, 25)
    assert Project(microsteps=1, step_angle=7, turn_distance=1).pulses_per_turn == Fraction(36000, 7)


@pytest.mark.parametrize("missing", ["microsteps", "step_angle", "turn_distance"])
def test_without_a_geometry_there_are_no_pulses(missing: str) -> None:
    values: dict[str, Any] = {"microsteps": 8, "step_angle": 180, "turn_distance": 1, missing: 0}
    assert Project(**values).pulses_per_unit is None


@pytest.mark.parametrize(
    ("first", "last", "count", "on"),
    [
        (1, 1, 1, True),
        (3, 5, 2, True),
        (0, 0, 0, False),
        (3, 2, 2, False),
        (4, 6, 2, False),
        (1, 2, 0, False),
    ],
)
def test_when_a_step_loop_is_carried_out(first: int, last: int, count: int, on: bool) -> None:
    assert Project(total_steps=5, loop_first=first, loop_last=last, loop_count=count).loop_is_on is on


def test_a_project_has_ten_steps_whatever_it_carries_out() -> None:
    project = table.with_steps(Project(number=1), (Step(distance=5), Step(distance=6, direction=1)))
    assert (project.total_steps, len(project.steps)) == (2, 10)
    assert [step.sign for step in project.steps[:2]] == [1, -1]
    assert project.step(2).distance == 6
    assert not project.is_cleared
    assert Project().is_cleared
    assert Project(project_loop=255).is_endless
    assert not Project(project_loop=254).is_endless
