"""A simulated device is timed, and which reading of the acceleration it has comes out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.program import Run, fit
from motorbus.families.stepper.simulator import simulate
from motorbus.families.stepper.table import Project, Step, with_steps
from tests.simulators.stepper.host import START, frame

MOTOR = Project(number=1, microsteps=8, step_angle=180, turn_distance=1)
SHORT = Step(distance=1, start_frequency=50, acceleration=30, speed=100, delay=100)


def projects() -> list[Project]:
    """Runs that are unlike: short and long, slow and fast."""
    steps = (
        SHORT,
        replace(SHORT, distance=3),
        replace(SHORT, distance=5, speed=300),
        replace(SHORT, distance=2, speed=200),
    )
    return [with_steps(MOTOR, (step,)) for step in steps]


def timed(project: Project, **options: Any) -> Run:
    """How long a simulated device takes, by the moments of its acknowledgement and of its notice."""
    bus = simulate((1,), **options)
    bus.controller.put(1, project)
    bus.receive(frame(START, 1), 0.0)
    (acknowledged, _), (ended, _) = bus.advance(1000.0)
    return Run(project, ended - acknowledged)


@pytest.mark.parametrize("tick", [0.25, 1.0, 10.0])
def test_the_tick_of_a_device_is_found(tick: float) -> None:
    best, other = fit([timed(project, ramp_tick_ms=tick, turnaround=0.004) for project in projects()])
    assert best.how.ramp == "time"
    assert best.tick_ms == best.how.ramp_tick_ms == pytest.approx(tick, rel=1e-4)
    assert best.overhead == pytest.approx(-0.004, abs=1e-5)  # the start is acknowledged after it has begun
    assert best.off < 1e-5
    assert other.off > 10 * best.off


def test_a_device_that_counts_pulses_is_found() -> None:
    best, other = fit([timed(project, ramp="pulse") for project in projects()])
    assert (best.how.ramp, best.tick_ms) == ("pulse", 0.0)
    assert best.off < 1e-9
    assert other.off > 1e-3


def test_two_runs_of_unlike_speeds_are_enough() -> None:
    runs = [timed(project, ramp_tick_ms=5.0) for project in projects()[1:3]]
    assert [one.tick_ms for one in fit(runs) if one.how.ramp == "time"] == [pytest.approx(5.0, rel=1e-3)]


@pytest.mark.parametrize(
    ("runs", "says"),
    [
        ([], "0 runs tell nothing"),
        ([Run(projects()[0], 1.0)], "1 runs tell nothing"),
        ([Run(projects()[0], 1.0), Run(projects()[0], 0.0)], "run 2: 0.0 s is no time"),
        ([Run(projects()[0], float("nan")), Run(projects()[0], 1.0)], "run 1: nan s"),
        (
            [Run(replace(projects()[0], project_loop=255), 1.0), Run(projects()[0], 1.0)],
            "run 1 has no time of its own",
        ),
        (
            [Run(projects()[0].with_step(1, start_input=1), 1.0), Run(projects()[0], 1.0)],
            "run 1 has no time of its own",
        ),
    ],
)
def test_runs_that_tell_nothing_are_refused(runs: list[Run], says: str) -> None:
    with pytest.raises(RequestError, match=says):
        fit(runs)
