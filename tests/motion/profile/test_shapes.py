"""The laws of a profile: exact ends, nothing beyond the limits, and each figure the sum of the next, summed here."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isclose, nan, sqrt
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.machine import AxisSpec
from motorbus.motion.profile import Limits, Profile, cubic, minimum_jerk, trapezoid

places = st.floats(-1000, 1000)
velocities = st.floats(0.01, 100)
accelerations = st.floats(0.01, 1000)
durations = st.floats(0.01, 1000)
SAMPLES = 1000


def moments(profile: Profile, count: int = SAMPLES) -> list[float]:
    return [profile.duration * index / count for index in range(count + 1)]


def summed(rate: Callable[[float], float], begin: float, end: float, steps: int = 800) -> float:
    """The integral by the midpoint rule: knows nothing of how a profile is made."""
    width = (end - begin) / steps
    return sum(rate(begin + (index + 0.5) * width) for index in range(steps)) * width


def assert_consistent(profile: Profile, steepest: float = 0.0) -> None:
    """Position is the sum of velocity, and velocity the sum of acceleration, which is never above `steepest`."""
    fastest = max(abs(profile.velocity(at)) for at in moments(profile, 100)) or 1.0
    steepest = steepest or max(abs(profile.acceleration(at)) for at in moments(profile, 100))
    slack = (fastest + steepest * profile.duration) * profile.duration / 1000
    for share in (0.2, 0.5, 0.77):
        end = share * profile.duration
        way = profile.position(end) - profile.position(0.0)
        gain = profile.velocity(end) - profile.velocity(0.0)
        assert isclose(way, summed(profile.velocity, 0.0, end), abs_tol=slack + 1e-9)
        gained = summed(profile.acceleration, 0.0, end)
        assert isclose(gain, gained, abs_tol=steepest * profile.duration / 500 + 1e-9)


# -- trapezoid -------------------------------------------------------------------------------------------------------


def test_a_trapezoid_worked_out_by_hand() -> None:
    # 2 s to 4 rad/s and 4 rad; 1 s to rest and 2 rad; 10 - 6 = 4 rad at 4 rad/s are 1 s
    lift = trapezoid(1.0, 11.0, velocity=4.0, acceleration=2.0, deceleration=4.0)
    assert (lift.start, lift.goal, lift.duration, lift.peak) == (1.0, 11.0, 4.0, 4.0)
    assert [lift.position(at) for at in (0.0, 1.0, 2.0, 3.0, 3.5, 4.0)] == [1.0, 2.0, 5.0, 9.0, 10.5, 11.0]
    assert [lift.velocity(at) for at in (0.0, 1.0, 2.5, 3.5, 4.0)] == [0.0, 2.0, 4.0, 2.0, 0.0]
    assert [lift.acceleration(at) for at in (0.5, 2.5, 3.5, 4.0)] == [2.0, 0.0, -4.0, 0.0]


def test_a_short_way_is_a_triangle_with_its_top_where_the_slopes_say() -> None:
    # up with 1, down with 3: three quarters of the time and of the way go into speeding up
    hop = trapezoid(0.0, -6.0, velocity=100.0, acceleration=1.0, deceleration=3.0)
    assert hop.peak == pytest.approx(3.0)
    assert hop.velocity(3.0) == pytest.approx(-3.0)
    assert hop.position(3.0) == pytest.approx(-4.5)
    assert hop.duration == pytest.approx(4.0)


def test_outside_its_time_it_stands_at_its_ends() -> None:
    lift = trapezoid(1.0, 2.0, velocity=1.0, acceleration=1.0)
    assert (lift.position(-5.0), lift.velocity(-5.0), lift.acceleration(-5.0)) == (1.0, 0.0, 0.0)
    assert (lift.position(99.0), lift.velocity(99.0), lift.acceleration(99.0)) == (2.0, 0.0, 0.0)


def test_no_way_takes_no_time() -> None:
    stay = trapezoid(3.0, 3.0, velocity=1.0, acceleration=1.0)
    assert (stay.duration, stay.peak, stay.position(0.0), stay.velocity(0.0)) == (0.0, 0.0, 3.0, 0.0)


@given(places, places, velocities, accelerations, accelerations)
def test_from_rest_it_stays_within_every_limit(
    start: float, goal: float, velocity: float, acceleration: float, deceleration: float
) -> None:
    lift = trapezoid(start, goal, velocity=velocity, acceleration=acceleration, deceleration=deceleration)
    low, high = sorted((start, goal))
    way = goal - start
    assert (lift.position(0.0), lift.position(lift.duration), lift.velocity(lift.duration)) == (
        start,
        goal,
        0,
    )
    for at in moments(lift):
        assert low - 1e-9 <= lift.position(at) <= high + 1e-9
        assert abs(lift.velocity(at)) <= min(velocity, lift.peak) * (1 + 1e-9)
        gain = lift.acceleration(at) if way >= 0 else -lift.acceleration(at)
        assert -deceleration * (1 + 1e-9) <= gain <= acceleration * (1 + 1e-9)


@given(places, places, velocities, accelerations, accelerations, st.floats(-200, 200))
def test_with_any_velocity_at_its_beginning_it_neither_jumps_nor_pulls_harder(
    start: float, goal: float, velocity: float, acceleration: float, deceleration: float, initial: float
) -> None:
    lift = trapezoid(
        start,
        goal,
        velocity=velocity,
        acceleration=acceleration,
        deceleration=deceleration,
        initial=initial,
    )
    hardest, fastest = max(acceleration, deceleration), max(velocity, abs(initial))
    assume(lift.duration < 1e5)
    width = lift.duration / SAMPLES
    slack = 1e-6 * max(1.0, fastest)
    assert isclose(lift.velocity(0.0), initial, abs_tol=slack) or not lift.duration
    assert lift.position(lift.duration) == goal
    for at in moments(lift)[1:]:
        before, now = lift.velocity(at - width), lift.velocity(at)
        assert abs(now) <= max(velocity, abs(initial)) * (1 + 1e-9)
        assert abs(now - before) <= hardest * width * (1 + 1e-6) + slack
        moved = lift.position(at) - lift.position(at - width)
        assert abs(moved) <= fastest * width * (1 + 1e-6) + 1e-6


@given(places, places, velocities, accelerations, accelerations, st.floats(-50, 50))
def test_a_trapezoid_is_the_sum_of_its_velocity(
    start: float, goal: float, velocity: float, acceleration: float, deceleration: float, initial: float
) -> None:
    lift = trapezoid(
        start, goal, velocity=velocity, acceleration=acceleration, deceleration=deceleration, initial=initial
    )
    assume(0 < lift.duration < 1e5)
    assert_consistent(lift, max(acceleration, deceleration))


@given(places, places, velocities, accelerations, accelerations, st.floats(1, 100))
def test_slowed_it_lasts_exactly_as_long_as_said(
    start: float, goal: float, velocity: float, acceleration: float, deceleration: float, factor: float
) -> None:
    lift = trapezoid(start, goal, velocity=velocity, acceleration=acceleration, deceleration=deceleration)
    slow = lift.lasting(lift.duration * factor)
    assert slow.duration == lift.duration * factor
    assert (slow.position(0.0), slow.position(slow.duration)) == (start, goal)
    assert isclose(slow.peak * factor, lift.peak, rel_tol=1e-9)
    for at in moments(lift, 20):
        assert isclose(slow.position(at * factor), lift.position(at), rel_tol=1e-9, abs_tol=1e-8)


def test_what_begins_in_motion_or_would_be_quicker_cannot_be_slowed() -> None:
    rolling = trapezoid(0.0, 1.0, velocity=1.0, acceleration=1.0, initial=0.5)
    resting = trapezoid(0.0, 1.0, velocity=1.0, acceleration=1.0)
    for profile, duration in ((rolling, 9.0), (resting, 0.5), (resting, inf), (resting, nan)):
        with pytest.raises(RequestError, match="no duration"):
            profile.lasting(duration)


# -- minimum jerk ----------------------------------------------------------------------------------------------------


def test_minimum_jerk_is_half_way_in_the_middle_and_fastest_there() -> None:
    reach = minimum_jerk(1.0, 3.0, duration=4.0)
    assert (reach.position(2.0), reach.velocity(2.0), reach.acceleration(2.0)) == (2.0, 0.9375, 0.0)
    assert reach.peak == 0.9375
    steepest = (3 - sqrt(3)) / 6 * 4.0
    assert reach.acceleration(steepest) == pytest.approx(10 / sqrt(3) * 2 / 16)
    ends = [rate(at) for rate in (reach.velocity, reach.acceleration) for at in (0.0, 4.0)]
    assert ends == pytest.approx([0.0] * 4)


@given(places, places, velocities, accelerations)
def test_minimum_jerk_uses_its_limits_up_and_never_exceeds_them(
    start: float, goal: float, velocity: float, acceleration: float
) -> None:
    assume(abs(goal - start) > 1e-6)
    reach = minimum_jerk(start, goal, velocity=velocity, acceleration=acceleration)
    fastest = max(abs(reach.velocity(at)) for at in moments(reach))
    steepest = max(abs(reach.acceleration(at)) for at in moments(reach))
    assert max(fastest, reach.peak) <= velocity * (1 + 1e-9)
    assert steepest <= acceleration * (1 + 1e-9)
    assert fastest >= velocity * (1 - 1e-4) or steepest >= acceleration * (1 - 1e-4)
    assert (reach.position(0.0), reach.position(reach.duration)) == (start, goal)


@given(places, places, durations)
def test_minimum_jerk_is_the_sum_of_its_velocity(start: float, goal: float, duration: float) -> None:
    assert_consistent(minimum_jerk(start, goal, duration=duration))


def test_minimum_jerk_has_less_jerk_than_a_quintic_that_is_a_little_off() -> None:
    """By numbers: the sum of jerk² of x and of x + ε·(a bump that keeps the ends) has its least at ε = 0."""
    width = 1e-3

    def cost(share: float) -> float:
        def place(at: float) -> float:
            bump = (at * (1 - at)) ** 3
            return minimum_jerk(0.0, 1.0, duration=1.0).position(at) + share * bump

        grid = [(index + 2) * width for index in range(996)]
        jerks = [
            (place(at + 2 * width) - 2 * place(at + width) + 2 * place(at - width) - place(at - 2 * width))
            / (2 * width**3)
            for at in grid
        ]
        return sum(jerk**2 for jerk in jerks) * width

    assert cost(0.0) < min(cost(-0.5), cost(0.5))


@pytest.mark.parametrize("said", [{}, {"velocity": 1.0}, {"acceleration": 1.0}])
def test_minimum_jerk_wants_to_know_how_fast(said: dict[str, float]) -> None:
    with pytest.raises(RequestError, match="how fast"):
        minimum_jerk(0.0, 1.0, **said)


def test_minimum_jerk_is_told_its_duration_once() -> None:
    with pytest.raises(RequestError, match="twice"):
        minimum_jerk(0.0, 1.0, duration=1.0, velocity=1.0)


# -- cubic -----------------------------------------------------------------------------------------------------------


@given(places, places, durations, st.floats(-50, 50), st.floats(-50, 50))
def test_a_cubic_has_the_velocities_it_was_given(
    start: float, goal: float, duration: float, first: float, last: float
) -> None:
    way = cubic(start, goal, duration=duration, first=first, last=last)
    slack = 1e-9 * (1 + abs(goal - start) / duration)
    assert isclose(way.velocity(0.0), first, abs_tol=slack)
    assert isclose(way.velocity(duration), last, rel_tol=1e-9, abs_tol=1e-9 + 10 * slack)
    assert (way.position(0.0), way.position(duration)) == (start, goal)
    fastest = max(abs(way.velocity(at)) for at in moments(way))
    assert fastest * (1 - 1e-6) - slack <= way.peak <= fastest * (1 + 1e-3) + 1e-4 * (way.peak + slack)
    assert_consistent(way)


# -- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("figure", [nan, inf, 0.0, -1.0])
@pytest.mark.parametrize("name", ["velocity", "acceleration", "deceleration"])
def test_a_limit_is_finite_and_above_nothing(name: str, figure: float) -> None:
    said: dict[str, Any] = {"velocity": 1.0, "acceleration": 1.0, name: figure}
    with pytest.raises(RequestError, match=f"^{name} is ") as refused:
        trapezoid(0.0, 1.0, **said)
    assert "above 0" in refused.value.expected
    if name != "deceleration":
        with pytest.raises(RequestError, match=f"^{name} is "):
            minimum_jerk(0.0, 1.0, **said)


@pytest.mark.parametrize("figure", [nan, inf, -inf])
def test_places_are_finite(figure: float) -> None:
    for start, goal, initial, name in (
        (figure, 0.0, 0.0, "start"),
        (0.0, figure, 0.0, "goal"),
        (0.0, 1.0, figure, "initial"),
    ):
        with pytest.raises(RequestError, match=f"^{name} is "):
            trapezoid(start, goal, velocity=1.0, acceleration=1.0, initial=initial)
    with pytest.raises(RequestError, match="^goal is "):
        minimum_jerk(0.0, figure, duration=1.0)
    with pytest.raises(RequestError, match="^first is "):
        cubic(0.0, 1.0, duration=1.0, first=figure, last=0.0)


@pytest.mark.parametrize("duration", [nan, inf, -1.0, 0.0])
def test_a_way_needs_a_duration(duration: float) -> None:
    with pytest.raises(RequestError, match="^duration is "):
        minimum_jerk(0.0, 1.0, duration=duration)


def test_ages_are_refused() -> None:
    with pytest.raises(RequestError, match="longer than can be counted"):
        trapezoid(0.0, 1e300, velocity=1e-300, acceleration=1.0)
    with pytest.raises(RequestError, match="longer than can be counted"):
        minimum_jerk(0.0, 1e300, velocity=1e-300, acceleration=1.0)


def test_limits_are_those_of_an_axis() -> None:
    axis = AxisSpec(device="arm#1", unit="deg", max_velocity=2.0, max_acceleration=9.0)
    assert Limits.of(axis) == Limits(2.0, 9.0)
    assert (Limits.of(axis).braking, Limits(2.0, 9.0, 4.0).braking) == (9.0, 4.0)
