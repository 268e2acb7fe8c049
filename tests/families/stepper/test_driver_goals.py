"""What the gate is told of a project, a move and a jog, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, tau

import pytest

from motorbus.core.operation import Goal
from motorbus.errors import LimitExceeded
from motorbus.families.stepper.driver import commands, goals
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.table import Project, Step, with_steps
from motorbus.motion.safety import Gate

THERE_AND_BACK = with_steps(
    Project(number=2, microsteps=8, step_angle=180, turn_distance=100),
    (Step(distance=300, speed=60), Step(distance=450, direction=1, speed=60)),
)


TURN = Goal(1, "speed", 60 * tau / 60, -inf, inf)
"""60 RPM."""


def turned(project: Project, how: Behaviour = USUAL) -> list[float]:
    """The ways that it is judged by, in turns."""
    return [
        goal.value / tau for goal in goals.of_project(Node(), project, how) if goal.quantity == "relative"
    ]


def test_a_project_orders_the_farthest_that_it_gets_in_each_direction() -> None:
    there, back, speed = goals.of_project(Node(), THERE_AND_BACK)
    assert (there, speed) == (Goal(1, "relative", 3 * tau, -inf, inf), TURN)
    assert back == Goal(1, "relative", back.value, -inf, inf)
    assert back.value == pytest.approx(-1.5 * tau)
    assert turned(with_steps(THERE_AND_BACK, (THERE_AND_BACK.step(2),))) == [-4.5]
    nowhere = Step(distance=0, speed=60)
    assert turned(with_steps(THERE_AND_BACK, (nowhere,))) == [0.0]
    stands = replace(THERE_AND_BACK.step(2), speed=0)
    assert turned(with_steps(THERE_AND_BACK, (THERE_AND_BACK.step(1), stands))) == [3.0], (
        "no speed, no way back"
    )


@pytest.mark.parametrize("said", ["total", "extra"])
def test_a_loop_counts_in_the_reading_that_leads_farthest(said: str) -> None:
    """Steps: 3 turns there, 4.5 back; a step loop of 2 is 2 or 3 times back, a project loop of 2 is 2 or 3 passes."""
    how = Behaviour(seg_loop=said, proj_loop=said)
    looped = replace(THERE_AND_BACK, loop_first=2, loop_last=2, loop_count=2)
    assert turned(looped, how) == pytest.approx([3, 3 - 3 * 4.5])
    assert turned(replace(THERE_AND_BACK, project_loop=2), how) == pytest.approx([3, 3 * -1.5])
    forth = with_steps(THERE_AND_BACK, (THERE_AND_BACK.step(1),))
    assert turned(replace(forth, project_loop=60), how) == pytest.approx([3 * 61])
    assert turned(replace(forth, project_loop=0), how) == [3.0]


def test_an_endless_project_is_a_velocity_too_and_leaves_any_travel_that_it_drifts_through() -> None:
    found = goals.of_project(Node(), replace(THERE_AND_BACK, project_loop=255))
    assert [goal.quantity for goal in found] == ["relative", "relative", "velocity", "speed"]
    assert found[1].value < -1e5
    assert found[2].value == pytest.approx(tau)
    there = THERE_AND_BACK.step(1)
    to_and_fro = with_steps(THERE_AND_BACK, (there, replace(there, direction=1)))
    assert turned(replace(to_and_fro, project_loop=255)) == [3.0], "it comes back in every pass"
    nowhere = with_steps(THERE_AND_BACK, (Step(distance=0, speed=60),))
    for how, endless in ((USUAL, False), (Behaviour(zero_distance="endless"), True)):
        assert ("velocity" in [one.quantity for one in goals.of_project(Node(), nowhere, how)]) == endless


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
