"""A bound that no behaviour undercuts: what the machine needs at least, with somebody at every button."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour, Happening, Phase
from motorbus.families.stepper.program import estimate
from motorbus.families.stepper.program.earliest import earliest
from motorbus.families.stepper.table import Project, decode_image, with_steps
from tests.families.stepper.behaviours import short_projects, switches
from tests.protocol.stepper.execution.course import project, step
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

LONGEST = 300.0


def ends(made: Project, how: Behaviour, presses: list[tuple[float, int]], at: float = 0.0) -> list[Happening]:
    """What happens when somebody presses these inputs, each after so long, and one that is waited for at once."""
    state = execution.start(execution.power_on(at, how).state, made, at).state
    told: list[Happening] = []
    queue = list(presses)
    now = at
    while state.busy and now < at + LONGEST:
        port = state.run.step.start_input if state.run and state.phase is Phase.WAIT else 0
        if port == 0 and queue:
            pause, port = queue.pop(0)
            now += pause
        elif port == 0:
            now = min(execution.due(state), at + LONGEST)
        for active in (True, False) if port else ():
            found = execution.set_input(state, port, active, now)
            told += found.told
            state = found.state
        found = execution.advance(state, now)
        told += found.told
        state = found.state
    return [one for one in told if one.kind == "ended"]


@settings(max_examples=400, deadline=None)
@given(
    made=short_projects(),
    how=switches(),
    presses=st.lists(st.tuples(st.floats(0, 2), st.sampled_from((1, 2, 5))), max_size=8),
)
def test_no_project_has_run_to_its_end_before_it(
    made: Project, how: dict[str, Any], presses: list[tuple[float, int]]
) -> None:
    for end in ends(made, Behaviour(**how), presses):
        assert end.at >= earliest(made) * (1 - 1e-12)


@settings(max_examples=200, deadline=None)
@given(made=projects())
def test_it_is_never_above_an_estimate(made: Project) -> None:
    found = estimate(made)
    assert earliest(made) >= 0
    assert made.is_endless or earliest(made) <= found.low * (1 + 1e-12)


@given(made=projects())
def test_it_is_finite_unless_the_project_is_endless(made: Project) -> None:
    assert (earliest(made) == inf) is made.is_endless


def test_the_examples_are_bounded_as_reckoned() -> None:
    assert earliest(decode_image(DUMP_A[6:])) == pytest.approx(1599 / (100 * 1600 / 60) + 1.0)
    first = 12799 / 6400 + 0.5
    cut = 1.0  # step 3 has a stop input, so only its pause counts
    assert earliest(decode_image(DUMP_B[6:])) == pytest.approx(3 * (first + 2 * (72720 / 32000) + 2 * cut))


def test_it_is_close_where_nothing_is_uncertain() -> None:
    steady = project(step(delay=250), step(distance=800))
    assert earliest(steady) == pytest.approx(estimate(steady).seconds, rel=2e-3)
    assert earliest(steady) < estimate(steady).seconds


@pytest.mark.parametrize(
    ("made", "seconds"),
    [
        (Project(), 0.0),
        (project(step(speed=0, delay=40)), 0.04),
        (project(step(start_input=1, delay=40)), 1599 / 1600 + 0.04),
        (project(step(stop_input=1, delay=40)), 0.04),
        (project(step(distance=0, delay=40), project_loop=5), 0.2),
        (project(step(distance=1, delay=40)), 0.04),
        (project(step(delay=0), step(distance=0, delay=10), loop_first=2, loop_last=2, loop_count=4), None),
        (project(step(), project_loop=255), inf),
        (with_steps(replace(project(), microsteps=0), (step(delay=7),)), 0.007),
        (project(step(start_frequency=3200)), 1599 / 3200),
    ],
)
def test_what_counts_and_what_does_not(made: Project, seconds: float | None) -> None:
    assert earliest(made) == pytest.approx(1599 / 1600 + 0.04 if seconds is None else seconds)
