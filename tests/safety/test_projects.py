"""A stored project is judged by all of its passes, and one without an end needs somebody who attends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, Refused
from motorbus.families.stepper.table import Project
from motorbus.session.robot import Robot
from motorbus.simulation.named import Simulation
from tests.families.stepper.runs import TURN, made
from tests.support.machines import machine

BACK = replace(TURN, direction=1)


def turned(sims: Mapping[str, Simulation]) -> float:
    """mm that the stage has gone: 1600 pulses make 5 mm."""
    return int(sims["stage"][1].status()["load"]) * 5 / 1600


def stored(sims: Mapping[str, Simulation], project: Project) -> None:
    sims["stage"][1].put(2, replace(project, number=2))


@pytest.mark.parametrize("step", [TURN, BACK], ids=["forward", "back"])
def test_a_loop_that_drifts_out_of_the_limits_is_not_started(step: Any) -> None:
    with machine(lift=True) as (file, sims), Robot.of(file) as robot:
        robot["lift"].declare(0.1)
        stored(sims, made(step, project_loop=60))
        with pytest.raises(LimitExceeded, match="lift: .* is outside 0.00 mm to 200.00 mm"):
            robot["lift"].device.start_project(2)
        robot["lift"].bus.link.advance(5.0)
        assert turned(sims) == 0.0


def test_one_that_comes_back_in_each_pass_is_started() -> None:
    with machine(lift=True) as (file, sims), Robot.of(file) as robot:
        robot["lift"].declare(0.1)
        stored(sims, made(TURN, BACK, project_loop=60))
        robot["lift"].device.start_project(2)
        robot["lift"].bus.link.advance(0.8)
        assert turned(sims) > 1.0
        robot["lift"].stop()


def test_an_endless_one_needs_somebody_who_attends_and_ends_with_him() -> None:
    with machine(lift=True) as (file, sims), Robot.of(file) as robot:
        robot["lift"].declare(0.1)
        stored(sims, made(TURN, BACK, project_loop=255))
        lift, gate = robot["lift"], robot.buses["stage"].interlock
        with pytest.raises(Refused, match="nobody attends") as caught:
            lift.device.start_project(2, endless=True)
        assert caught.value.reason == "unattended"
        with robot.attended():
            lift.device.start_project(2, endless=True)
            lift.bus.link.advance(30.0)
            assert sims["stage"][1].status()["project"] == 2
            assert gate.goes_on(1)  # type: ignore[union-attr]
        lift.bus.link.advance(5.0)
        assert sims["stage"][1].status()["project"] is None
