"""A guard bounds how far, how quickly and in what steps; who stands outside may come back."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.operation import Goal
from motorbus.errors import LimitExceeded, Refused
from motorbus.motion.limits import SLOWEST
from motorbus.motion.moving.lagging import FAR, LAG
from motorbus.motion.safety.guard import LATE, NEAR, ROUNDED, UNIT, Bounds, Guard

BOUNDS = Bounds(-1.0, 2.0, 0.5, 3.0)


def guarded(here: float | None = 0.0, bounds: Bounds = BOUNDS, measures: bool = True) -> Guard:
    guard = Guard("elbow", bounds, measures=measures)
    if here is not None and guard.track is not None:
        guard.track.take(here, 10.0)
    return guard


def place(value: float) -> Goal:
    return Goal(7, "position", value, -9.0, 9.0)


def way(value: float) -> Goal:
    return Goal(7, "relative", value, -9.0, 9.0)


def passes(guard: Guard, goal: Goal) -> bool:
    try:
        guard.check_goal(goal)
    except LimitExceeded:
        return False
    return True


@pytest.mark.parametrize("value", [0.0, 0.5, -0.5, 0.5 + ROUNDED / 2])
def test_what_is_inside_and_near_passes(value: float) -> None:
    guarded().check_goal(place(value))
    guarded().check_goal(way(value))


@pytest.mark.parametrize(
    ("here", "goal", "says", "reason"),
    [
        (1.8, place(2.01), r"elbow: 2.01 rad is outside -1 rad to 2 rad", "limits"),
        (1.8, way(0.21), r"elbow: 2.01 rad is outside", "limits"),
        (0.0, place(0.51), r"this is 0.51 rad of its device from where it is, .* may be 0.5 rad", "step"),
        (0.0, way(-0.51), "this is 0.51 rad", "step"),
    ],
)
def test_what_is_not_is_refused_and_the_reason_told(here: float, goal: Goal, says: str, reason: str) -> None:
    with pytest.raises(LimitExceeded, match=says) as caught:
        guarded(here).check_goal(goal)
    assert (caught.value.reason, caught.value.node) == (reason, 7)
    assert "nothing was sent" in str(caught.value)


def test_who_stands_outside_may_come_back_and_not_go_farther() -> None:
    guard = guarded(2.4)
    assert passes(guard, place(2.4))
    assert passes(guard, place(2.0))
    assert not passes(guard, place(2.41))
    assert not passes(guarded(-1.4), place(-1.5))
    assert not passes(guarded(-1.4), place(-1.4 - ROUNDED / 2))


def test_of_who_does_not_tell_where_it_is_only_the_way_is_judged() -> None:
    guard = guarded(None, BOUNDS._replace(step=5.0, speed=inf), measures=False)
    guard.check_known(7, 99.0)
    assert passes(guard, way(-3.0))
    assert not passes(guard, way(3.1))
    assert not passes(guarded(None, measures=False), way(0.6))


@pytest.mark.parametrize(("value", "fine"), [(3.0, True), (-3.0, True), (3.0 + UNIT, True), (3.1, False)])
def test_speed_has_a_bound_in_both_directions(value: float, fine: bool) -> None:
    goal = Goal(7, "speed", value, -50.0, 50.0)
    if fine:
        guarded().check_speed(goal)
    else:
        with pytest.raises(LimitExceeded, match="3.1 rad/s of its device is above 3 rad/s"):
            guarded().check_speed(goal)


def test_it_must_be_known_where_it_is() -> None:
    with pytest.raises(Refused, match="elbow: nobody has read where it is") as unseen:
        guarded(None).check_known(7, 10.0)
    guard = guarded()
    guard.check_known(7, 10.1)
    with pytest.raises(Refused, match=r"where it is was read 2 s ago") as stale:
        guard.check_known(7, 12.0)
    assert guard.track is not None
    guard.track.take(3.0, 10.05)
    with pytest.raises(Refused, match="read at 3 rad, where no motor can have come so quickly") as suspect:
        guard.check_known(7, 10.1)
    reasons = [one.value.reason for one in (unseen, stale, suspect)]
    assert reasons == ["stale", "stale", "suspect"]
    assert not isinstance(stale.value, LimitExceeded)


@given(st.floats(-4, 4), st.floats(-4, 4))
def test_a_place_passes_exactly_when_it_is_inside_and_near(here: float, to: float) -> None:
    low, high = min(BOUNDS.low, here), max(BOUNDS.high, here)
    fine = low <= to <= high and abs(to - here) <= BOUNDS.step
    beyond = max(low - to, to - high, abs(to - here) - BOUNDS.step)
    if fine:
        assert passes(guarded(here), place(to))
    elif beyond > 2 * ROUNDED:
        assert not passes(guarded(here), place(to))


@given(st.floats(-4, 4), st.floats(-4, 4))
def test_a_way_is_judged_as_the_place_that_it_leads_to(here: float, by: float) -> None:
    assert (
        passes(guarded(here), way(by)) == passes(guarded(here), place(here + by))
        or abs(abs(by) - BOUNDS.step) < 2 * ROUNDED
    )


@pytest.mark.parametrize(("speed", "far"), [(0.1, 0.18), (1.0, 0.9)])
def test_what_comes_without_a_speed_leads_no_farther_than_goals_of_one_that_is_led(
    speed: float, far: float
) -> None:
    guard = guarded(bounds=Bounds(speed=speed))
    for goal in (place(far), place(-far), way(far)):
        guard.check_goal(goal)
    assert guard.is_fine(far, 10.0)
    assert not guard.is_fine(far + 2 * ROUNDED, 10.0)
    for goal in (place(far + 2 * ROUNDED), way(-far - 2 * ROUNDED)):
        with pytest.raises(
            LimitExceeded, match="comes without a velocity, so .* as fast as it can"
        ) as caught:
            guard.check_goal(goal)
        assert (caught.value.reason, caught.value.node) == ("velocity", 7)
        assert "nothing was sent" in str(caught.value)
        guard.check_goal(goal, paced=True)


def test_who_is_led_as_slowly_and_lags_as_far_as_he_may_is_not_ordered_too_far() -> None:
    assert pytest.approx(LAG + 2 / SLOWEST) == LATE
    assert NEAR == FAR


def test_ways_that_are_told_before_the_last_one_has_ended_are_added_up() -> None:
    guard = Guard("a1", Bounds(0.0, 1.0))
    assert guard.track is not None
    guard.track.take(0.5, 0.0)
    way = Goal(1, "relative", 0.3, -9.0, 9.0)
    guard.check_goal(way, paced=True)
    guard.adds(0.3)
    with pytest.raises(LimitExceeded, match="1.1 rad is outside"):
        guard.check_goal(way, paced=True)
    guard.adds(0.0, ends=True)
    guard.check_goal(way, paced=True)
