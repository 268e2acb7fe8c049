"""The own follower: trapezoids, one after the other, that meet in position and velocity."""

from __future__ import annotations

from math import isclose

from hypothesis import given
from hypothesis import strategies as st

from motorbus.motion.profile import Limits, TrapezoidFollower, follower, trapezoid
from tests.motion.profile import followers
from tests.motion.profile.followers import Chase, chase, chases, limits

USUAL = Limits(1.0, 4.0)


@given(st.floats(-10, 10), limits, chases)
def test_it_follows_gently_whatever_the_goals_do(start: float, may: Limits, goals: Chase) -> None:
    one = follower(start, may)
    seen = chase(one, goals)
    followers.assert_gentle(seen, goals, may, max(may.acceleration, may.braking))
    assert one.goal == goals[-1][0]
    followers.settle(one)


@given(st.floats(-10, 10), limits, st.floats(-10, 10), st.floats(-10, 10), st.floats(0, 5))
def test_a_new_goal_keeps_position_and_velocity(
    start: float, may: Limits, first: float, second: float, at: float
) -> None:
    one = TrapezoidFollower(start, may)
    one.step(at, first)
    before = one.position, one.velocity
    one.step(0.0, second)
    assert isclose(one.position, before[0], abs_tol=1e-9)
    assert isclose(one.velocity, before[1], abs_tol=1e-9)


def test_one_goal_is_one_trapezoid_however_it_is_stepped() -> None:
    whole = trapezoid(0.0, 1.0, velocity=1.0, acceleration=4.0)
    one = follower(0.0, USUAL)
    at = 0.0
    for elapsed in (0.004, 0.2, 0.0, 0.0301, 0.5, 0.1):
        at += elapsed
        assert isclose(one.step(elapsed, 1.0), whole.position(at), abs_tol=1e-12)
    assert not one.arrived
    assert one.step(whole.duration) == 1.0
    assert one.arrived


def test_at_rest_until_there_is_a_goal() -> None:
    one = follower(0.5, USUAL)
    assert (one.step(1.0), one.velocity, one.arrived, one.goal) == (0.5, 0.0, True, 0.5)


def test_nonsense_is_refused() -> None:
    followers.assert_refuses_nonsense(follower(0.0, USUAL))


def test_a_reset_starts_again() -> None:
    followers.assert_starts_again(follower(0.0, USUAL))


@given(st.floats(-10, 10), limits, chases)
def test_its_bare_numbers_are_those_of_the_trapezoid(start: float, may: Limits, goals: Chase) -> None:
    one = TrapezoidFollower(start, may)
    for goal, steps in goals:
        way = trapezoid(
            one.position, goal, velocity=may.velocity, acceleration=may.acceleration,
            deceleration=may.deceleration, initial=one.velocity,
        )  # fmt: skip
        for number in range(1, steps + 1):
            elapsed = number * followers.PERIOD
            assert isclose(
                one.step(followers.PERIOD, goal), way.position(elapsed), rel_tol=1e-9, abs_tol=1e-9
            )
            assert isclose(one.velocity, way.velocity(elapsed), rel_tol=1e-7, abs_tol=1e-6)


def test_braking_ends_where_it_must_and_no_farther() -> None:
    one = follower(0.0, USUAL)
    for _ in range(100):
        one.step(0.001, 5.0)
    one.halt()
    assert isclose(one.goal, 0.04, abs_tol=1e-9)
    places = [one.step(0.001) for _ in range(101)]
    assert places == sorted(places)
    assert (places[-1], one.velocity, one.arrived) == (one.goal, 0.0, True)


def test_braking_at_rest_is_nothing() -> None:
    one = follower(0.5, USUAL)
    one.halt()
    assert (one.goal, one.step(0.1), one.arrived) == (0.5, 0.5, True)
