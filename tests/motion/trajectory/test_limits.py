"""Limits of a trajectory: what is planned within them passes, and of what is not the first sample is named."""

from __future__ import annotations

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.machine import AxisSpec
from motorbus.motion.profile import Kind, Limits, Move, synchronised
from motorbus.motion.trajectory import (
    Trajectory,
    Violation,
    check,
    first_violation,
    sampled,
)

LIFT = AxisSpec(device="arm#1", unit="deg", low=-1.0, high=1.0, max_velocity=2.0, max_acceleration=10.0)
SLIDE = AxisSpec(
    device="arm#2", unit="mm", travel=0.005, low=0.0, high=0.1, max_velocity=0.05, max_acceleration=1.0
)
AXES = {"lift": LIFT, "slide": SLIDE}


def lifting(times: list[float], places: list[float]) -> Trajectory:
    return Trajectory(times, {"lift": places})


@given(
    st.sampled_from(["trapezoid", "minimum_jerk"]),
    st.floats(-1, 1),
    st.floats(-1, 1),
    st.floats(0, 0.1),
    st.floats(0, 0.1),
    st.floats(10, 2000),
)
def test_what_is_planned_within_limits_passes_at_any_rate(
    kind: Kind, start: float, goal: float, begin: float, end: float, rate: float
) -> None:
    moves = {"lift": Move(start, goal, Limits.of(LIFT)), "slide": Move(begin, end, Limits.of(SLIDE))}
    group = synchronised(moves, kind=kind)
    if group.duration:
        check(sampled(group, rate), AXES)


@given(st.sampled_from(["trapezoid", "minimum_jerk"]), st.floats(0.2, 2), st.floats(0.5, 0.95))
def test_what_is_made_quicker_than_its_limits_is_found(kind: Kind, way: float, factor: float) -> None:
    group = synchronised({"lift": Move(-1.0, way - 1.0, Limits.of(LIFT))}, kind=kind)
    plan = sampled(group, 1000)
    quicker = Trajectory([at * factor for at in plan.times], plan.axes)
    found = first_violation(quicker, AXES)
    assert found is not None
    assert found.what in ("velocity", "acceleration")
    assert abs(found.value) > found.limit


def test_the_first_one_in_time_is_named_whatever_the_order_of_the_axes() -> None:
    places = {"lift": [0.0, 0.0, 0.0, 1.5], "slide": [0.0, 0.0, -0.01, 0.0]}
    found = first_violation(Trajectory([0.0, 1.0, 2.0, 3.0], places), AXES)
    assert found == Violation("slide", "position", 2.0, -0.01, 0.0)
    assert found.told(SLIDE) == "slide: its position at 2 s is -10 mm, and its limit is 0 mm"


def test_a_velocity_is_told_in_the_unit_of_the_axis() -> None:
    steep = AxisSpec(device="arm#1", unit="deg", max_velocity=pi / 2, max_acceleration=1e6)
    found = first_violation(lifting([0.0, 1.0, 2.0], [0.0, 0.0, -pi]), {"lift": steep})
    assert found == Violation("lift", "velocity", 2.0, -pi, pi / 2)
    assert found.told(steep) == "lift: its velocity at 2 s is -180 deg/s, and its limit is 90 deg/s"


def test_an_acceleration_is_judged_between_the_middles_of_two_stretches() -> None:
    gentle = AxisSpec(device="arm#1", unit="rad", max_velocity=100.0, max_acceleration=0.5)
    # 0 to 1 rad/s between 0.5 s and 2 s: 1 / 1.5
    found = first_violation(lifting([0.0, 1.0, 3.0], [0.0, 0.0, 2.0]), {"lift": gentle})
    assert found == Violation("lift", "acceleration", 1.0, 1 / 1.5, 0.5)
    assert (
        found.told(gentle) == "lift: its acceleration at 1 s is 0.666667 rad/s², and its limit is 0.5 rad/s²"
    )


@pytest.mark.parametrize(("places", "at"), [([0.0, 0.5, 0.5, 0.5], 0.0), ([0.0, 0.0, 0.0, -0.5], 3.0)])
def test_it_begins_and_ends_at_rest(places: list[float], at: float) -> None:
    gentle = AxisSpec(device="arm#1", unit="rad", max_velocity=100.0, max_acceleration=0.9)
    found = first_violation(lifting([0.0, 1.0, 2.0, 3.0], places), {"lift": gentle})
    assert found == Violation("lift", "acceleration", at, 1.0, 0.9)


def test_a_corner_is_as_hard_as_the_loop_makes_it() -> None:
    route = Trajectory([0.0, 2.0], {"lift": [-1.0, 1.0]})
    found = first_violation(sampled(route, 200), AXES)
    assert found is not None
    assert (found.what, found.at) == ("acceleration", 0.0)
    assert found.value == pytest.approx(1.0 / 0.0025)
    check(sampled(route.joined("spline"), 200), AXES)


def test_without_limits_of_position_any_position_passes() -> None:
    wheel = AxisSpec(device="arm#1", unit="turn", max_velocity=1e3, max_acceleration=1e5)
    check(lifting([0.0, 10.0, 20.0], [0.0, 500.0, 900.0]), {"lift": wheel})


def test_the_error_says_what_to_do() -> None:
    with pytest.raises(LimitExceeded, match="lift: its position at 1 s is 85.9437 deg") as refused:
        check(lifting([0.0, 1.0], [0.0, 1.5]), AXES)
    assert "low and high" in refused.value.advice
    assert refused.value.advice.endswith("nothing was sent")


def test_an_axis_that_is_not_there_is_named_with_the_nearest() -> None:
    with pytest.raises(RequestError, match="no axis 'lfit'") as refused:
        check(Trajectory([0.0, 1.0], {"lfit": [0.0, 0.0]}), AXES)
    assert refused.value.advice == "did you mean lift?"
