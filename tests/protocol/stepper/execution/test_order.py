"""The order of steps against the vectors and against an expansion of our own; pulses and their rounding."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import islice
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour, Place
from motorbus.families.stepper.table import Project, Step, with_steps
from tests.protocol.stepper.execution import exact
from tests.protocol.stepper.vectors import behaviour


def looped(total: int, first: int, last: int, count: int, project_loop: int = 0) -> Project:
    return Project(
        total_steps=total, loop_first=first, loop_last=last, loop_count=count, project_loop=project_loop
    )


def order(project: Project, how: Behaviour | None = None) -> list[int]:
    return [place.step for place in execution.one_pass(project, how or Behaviour())]


@pytest.mark.parametrize("vector", behaviour("order"), ids=lambda v: f"{v['total_steps']}-{v['loop']}")
def test_a_known_order(vector: dict[str, Any]) -> None:
    first, last, count = vector["loop"]
    project = looped(vector["total_steps"], first, last, count, vector["project_loop"])
    assert order(project) == vector["order"]
    assert execution.passes(project) == vector["passes"]


@given(st.integers(1, 10), st.integers(0, 11), st.integers(0, 11), st.integers(0, 254))
def test_any_order_is_the_one_written_out(total: int, first: int, last: int, count: int) -> None:
    project = looped(total, first, last, count)
    written = exact.order_of(total, first, last, count)
    assert order(project) == written
    for step in range(12):
        assert execution.times_in_a_pass(project, step) == written.count(step)
    if project.loop_is_on:
        assert len(written) == total + (count - 1) * (last - first + 1)


def test_the_pass_of_the_loop_is_told() -> None:
    places = list(execution.one_pass(looped(4, 2, 3, 2)))
    assert places == [Place(1), Place(2), Place(3), Place(2, 2), Place(3, 2), Place(4)]


def test_another_reading_of_the_counts_is_one_more() -> None:
    extra = Behaviour(seg_loop="extra", proj_loop="extra")
    project = looped(8, 3, 5, 2, 3)
    assert order(project, extra) == exact.order_of(8, 3, 5, 3)
    assert execution.passes(project, extra) == 4
    assert execution.passes(looped(1, 0, 0, 0, 0), extra) == 1
    assert execution.passes(looped(1, 0, 0, 0, 255), extra) is None
    assert execution.laps(looped(5, 4, 6, 2), extra) == 1  # no range, so no loop


@pytest.mark.parametrize(("count", "runs"), [(0, 1), (1, 1), (2, 2), (254, 254)])
def test_how_often_a_project_runs(count: int, runs: int) -> None:
    assert execution.passes(looped(1, 0, 0, 0, count)) == runs


def test_a_cleared_project_has_no_order() -> None:
    assert order(Project()) == []
    assert len(order(Project(total_steps=200))) == 10  # no more rows are there


# --- pulses ----------------------------------------------------------------------------------------------------

GEOMETRY = Project(microsteps=16, step_angle=90, turn_distance=5000, total_steps=3)


@pytest.mark.parametrize(("rounding", "sent"), [("trunc", 72721), ("nearest", 72722), ("carry", 72721)])
def test_pulses_that_are_not_whole(rounding: str, sent: int) -> None:
    step = Step(distance=56814, direction=1, speed=300)
    assert execution.exact_pulses(GEOMETRY, step) == Fraction(7272192, 100)
    found, residue = execution.pulses(GEOMETRY, step, Behaviour(rounding=rounding))
    assert found == sent
    assert residue == (Fraction(-92, 100) if rounding == "carry" else 0)


@given(st.lists(st.tuples(st.integers(0, 9999), st.integers(0, 1)), max_size=40))
def test_what_is_carried_on_is_never_lost(moves: list[tuple[int, int]]) -> None:
    how = Behaviour(rounding="carry")
    residue, where, wanted = Fraction(0), 0, Fraction(0)
    for distance, direction in moves:
        step = Step(distance=distance, direction=direction, speed=300)
        sent, residue = execution.pulses(GEOMETRY, step, how, residue)
        where += step.sign * sent
        wanted += step.sign * execution.exact_pulses(GEOMETRY, step)
        assert wanted - where == residue
        assert abs(residue) <= 1


@given(
    st.lists(st.tuples(st.integers(0, 9999), st.integers(0, 1), st.integers(0, 2)), min_size=3, max_size=3),
    st.integers(1, 5),
    st.integers(1, 4),
    st.sampled_from(["trunc", "nearest", "carry"]),
)
def test_what_is_sent_in_all_is_what_each_step_sends(
    moves: list[tuple[int, int, int]], laps: int, rounds: int, rounding: str
) -> None:
    how = Behaviour(rounding=rounding)
    steps = [
        Step(distance=distance, direction=direction, speed=speed) for distance, direction, speed in moves
    ]
    project = replace(
        with_steps(GEOMETRY, tuple(steps)), loop_first=2, loop_last=3, loop_count=laps, project_loop=rounds
    )
    counted: dict[int, dict[int, int]] = {1: {}, 2: {}, 3: {}}
    residue = Fraction(0)
    for place in [*execution.one_pass(project, how)] * rounds:
        sent, residue = execution.pulses(project, project.step(place.step), how, residue)
        counted[place.step][sent] = counted[place.step].get(sent, 0) + 1
    assert execution.sent_in_all(project, how) == counted


def test_without_a_geometry_nothing_moves() -> None:
    assert execution.pulses(Project(), Step(distance=5)) == (0, Fraction(0))
    assert execution.frequency(Project(), Step(speed=5)) == 0
    assert execution.move(Project(), Step(speed=5), None).duration == 0


def test_the_ramp_is_that_of_the_step_and_the_reading() -> None:
    step = Step(start_frequency=0, acceleration=30)
    assert execution.ramp_of(step) == execution.Ramp(1.0, 30_000.0, False)
    assert execution.ramp_of(step, Behaviour(ramp_tick_ms=10.0)).rate == 3000
    assert execution.ramp_of(step, Behaviour(ramp="pulse")) == execution.Ramp(1.0, 30.0, True)


def test_a_place_after_the_last_is_none() -> None:
    assert execution.following(looped(3, 0, 0, 0), Place(3)) is None
    assert list(islice(execution.one_pass(looped(1, 1, 1, 254)), 255))[-1] == Place(1, 254)
