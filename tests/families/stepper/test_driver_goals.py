"""What the gate is told of a project, a move and a jog, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, tau

import pytest

from motorbus.core.operation import Goal
from motorbus.errors import LimitExceeded
from motorbus.families.stepper.driver import commands, goals
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.table import Project, Step, with_steps
from motorbus.motion.safety import Gate

THERE_AND_BACK = with_steps(
    Project(number=2, microsteps=8, step_angle=180, turn_distance=100),
    (Step(distance=300, speed=60), Step(distance=450, direction=1, speed=60)),
)


TURN = Goal(1, "speed", 60 * tau / 60, -inf, inf)
"""60 RPM."""


def test_a_project_orders_the_farthest_that_a_pass_gets() -> None:
    assert goals.of_project(Node(), THERE_AND_BACK) == (Goal(1, "relative", 3 * tau, -inf, inf), TURN)
    further = replace(THERE_AND_BACK, loop_first=2, loop_last=2, loop_count=2)
    assert goals.of_project(Node(), further) == (Goal(1, "relative", -6 * tau, -inf, inf), TURN)


def test_a_single_move_and_a_jog_take_step_1() -> None:
    assert goals.of_move(Node(), THERE_AND_BACK) == (Goal(1, "relative", 3 * tau, -inf, inf), TURN)
    (jog,) = goals.of_jog(Node(), THERE_AND_BACK, -1)
    assert jog == Goal(1, "velocity", jog.value, -inf, inf)
    assert jog.value == pytest.approx(-tau)


def test_what_cannot_be_said_in_angles_does_not_pass_the_gate() -> None:
    found = goals.of_project(Node(), replace(THERE_AND_BACK, turn_distance=0))
    assert isnan(found[0].value)
    with pytest.raises(LimitExceeded, match="not a finite number"):
        Gate()(commands.motion(Node(), "start_project", found, project=2))
