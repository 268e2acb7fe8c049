"""The follower: trapezoids, one after the other, that meet in position and velocity."""

from __future__ import annotations

from itertools import pairwise
from math import inf, isclose, nan
from typing import TypeAlias

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.profile import Follower, Limits, trapezoid

Chase: TypeAlias = list[tuple[float, int]]
"""Goals, and for how many steps each of them holds."""
PERIOD = 0.01
chases: st.SearchStrategy[Chase] = st.lists(
    st.tuples(st.floats(-10, 10), st.integers(1, 60)), min_size=1, max_size=6
)
limits = st.builds(Limits, st.floats(0.1, 20), st.floats(0.1, 100), st.none() | st.floats(0.1, 100))


def chase(one: Follower, goals: Chase) -> list[tuple[float, float]]:
    """Position and velocity after each step, from where it is."""
    seen = [(one.position, one.velocity)]
    for goal, steps in goals:
        for _ in range(steps):
            position = one.step(PERIOD, goal)
            assert position == one.position
            seen.append((position, one.velocity))
    return seen


def assert_gentle(seen: list[tuple[float, float]], goals: Chase, may: Limits, hardest: float) -> None:
    """Within velocity and acceleration, position the sum of velocity, and inside what goals and start enclose."""
    places = [seen[0][0], *(goal for goal, _ in goals)]
    low, high = min(places), max(places)
    for (before, slow), (position, velocity) in pairwise(seen):
        assert abs(velocity) <= may.velocity * (1 + 1e-6)
        assert abs(velocity - slow) <= hardest * PERIOD * (1 + 1e-6) + 1e-9
        assert abs(position - before - (velocity + slow) / 2 * PERIOD) <= hardest * PERIOD**2 + 1e-9
        assert low - 1e-6 <= position <= high + 1e-6


def settle(one: Follower) -> None:
    """Let it arrive."""
    one.step(1e6)
    assert one.arrived
    assert (one.position, one.velocity) == (one.goal, 0.0)


def assert_refuses_nonsense(one: Follower) -> None:
    """Bad figures change nothing."""
    one.step(0.05, 1.0)
    before = one.position, one.velocity, one.goal
    for figure in (nan, inf):
        with pytest.raises(RequestError, match="have gone by"):
            one.step(figure)
        with pytest.raises(RequestError, match="goal is"):
            one.step(0.1, figure)
        with pytest.raises(RequestError, match=r"(position|start) is"):
            one.reset(figure)
    with pytest.raises(RequestError, match="have gone by"):
        one.step(-0.1)
    assert (one.position, one.velocity, one.goal) == before


def assert_starts_again(one: Follower) -> None:
    """After a reset it rests where it was put."""
    one.step(0.1, 5.0)
    one.reset(2.0)
    assert (one.position, one.velocity, one.goal, one.arrived) == (2.0, 0.0, 2.0, True)
    assert one.step(1.0) == 2.0


USUAL = Limits(1.0, 4.0)


@given(st.floats(-10, 10), limits, chases)
def test_it_follows_gently_whatever_the_goals_do(start: float, may: Limits, goals: Chase) -> None:
    one = Follower(start, may)
    seen = chase(one, goals)
    assert_gentle(seen, goals, may, max(may.acceleration, may.braking))
    assert one.goal == goals[-1][0]
    settle(one)


@given(st.floats(-10, 10), limits, st.floats(-10, 10), st.floats(-10, 10), st.floats(0, 5))
def test_a_new_goal_keeps_position_and_velocity(
    start: float, may: Limits, first: float, second: float, at: float
) -> None:
    one = Follower(start, may)
    one.step(at, first)
    before = one.position, one.velocity
    one.step(0.0, second)
    assert isclose(one.position, before[0], abs_tol=1e-9)
    assert isclose(one.velocity, before[1], abs_tol=1e-9)


def test_one_goal_is_one_trapezoid_however_it_is_stepped() -> None:
    whole = trapezoid(0.0, 1.0, velocity=1.0, acceleration=4.0)
    one = Follower(0.0, USUAL)
    at = 0.0
    for elapsed in (0.004, 0.2, 0.0, 0.0301, 0.5, 0.1):
        at += elapsed
        assert isclose(one.step(elapsed, 1.0), whole.position(at), abs_tol=1e-12)
    assert not one.arrived
    assert one.step(whole.duration) == 1.0
    assert one.arrived


def test_at_rest_until_there_is_a_goal() -> None:
    one = Follower(0.5, USUAL)
    assert (one.step(1.0), one.velocity, one.arrived, one.goal) == (0.5, 0.0, True, 0.5)


def test_nonsense_is_refused() -> None:
    assert_refuses_nonsense(Follower(0.0, USUAL))


def test_a_reset_starts_again() -> None:
    assert_starts_again(Follower(0.0, USUAL))


@given(st.floats(-10, 10), limits, chases)
def test_its_bare_numbers_are_those_of_the_trapezoid(start: float, may: Limits, goals: Chase) -> None:
    one = Follower(start, may)
    for goal, steps in goals:
        way = trapezoid(
            one.position, goal, velocity=may.velocity, acceleration=may.acceleration,
            deceleration=may.deceleration, initial=one.velocity,
        )  # fmt: skip
        for number in range(1, steps + 1):
            elapsed = number * PERIOD
            assert isclose(one.step(PERIOD, goal), way.position(elapsed), rel_tol=1e-9, abs_tol=1e-9)
            assert isclose(one.velocity, way.velocity(elapsed), rel_tol=1e-7, abs_tol=1e-6)


def test_braking_ends_where_it_must_and_no_farther() -> None:
    one = Follower(0.0, USUAL)
    for _ in range(100):
        one.step(0.001, 5.0)
    one.halt()
    assert isclose(one.goal, 0.04, abs_tol=1e-9)
    places = [one.step(0.001) for _ in range(101)]
    assert places == sorted(places)
    assert (places[-1], one.velocity, one.arrived) == (one.goal, 0.0, True)


def test_braking_at_rest_is_nothing() -> None:
    one = Follower(0.5, USUAL)
    one.halt()
    assert (one.goal, one.step(0.1), one.arrived) == (0.5, 0.5, True)
