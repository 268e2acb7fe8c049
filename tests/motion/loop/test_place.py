"""One axis in a loop: its goals are judged before they are sent, and followed within its limits."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import inf, nan, pi, radians
from typing import Any

import pytest

from motorbus.errors import LimitExceeded
from motorbus.motion.loop.place import CATCH_UP, Place
from motorbus.motion.safety.guard import LATE, NEAR
from motorbus.motion.safety.track import FRESH
from motorbus.session.robot import Robot
from tests.support.machines import machine

PERIOD = 0.01
STEP = radians(90) * PERIOD


@pytest.fixture
def axis() -> Iterator[Any]:
    """90 deg/s, 360 deg/s², -150 to 150 deg; its device is at pi where it is at 0."""
    with machine(arm="1", axes={"a1": {"max_step": "20 deg"}}) as (made, _), Robot.of(made) as robot:
        yield robot["a1"]


def place(axis: Any, *, direct: bool = False) -> Place:
    axis.departs()
    found = Place(axis, None, PERIOD, direct)
    found.begin(0.0)
    return found


def led(one: Place, goal: float, periods: int = 1) -> float:
    """The next order, as a position of the axis; it obeys at once."""
    one.asked = goal
    one.judge(periods)
    one.position = one.step(periods) - pi
    return one.position


def test_a_goal_is_followed_within_velocity_and_acceleration(axis: Any) -> None:
    one = place(axis)
    way = [0.0] + [led(one, 1.0) for _ in range(120)]
    speeds = [(after - before) / PERIOD for before, after in pairwise(way)]
    assert max(speeds) == pytest.approx(radians(90), rel=1e-6)
    assert (
        max(abs(after - before) for before, after in pairwise([0.0, *speeds]))
        <= radians(360) * PERIOD * 1.001
    )
    assert way[-1] == pytest.approx(1.0)
    assert one.arrived


@pytest.mark.parametrize("goal", [nan, inf, radians(151), -radians(151)])
@pytest.mark.parametrize("direct", [False, True])
def test_what_must_not_be_sent_is_refused_and_forgotten(axis: Any, goal: float, direct: bool) -> None:
    one = place(axis, direct=direct)
    led(one, 0.001)
    one.asked = goal
    with pytest.raises(LimitExceeded, match="a1: (its|the) goal"):
        one.judge(1)
    assert one.asked == 0.001
    one.judge(1)
    assert not one.allows(goal)


def test_its_device_may_allow_less(axis: Any) -> None:
    one = Place(axis, (pi - 0.5, pi + 0.5), PERIOD, False)
    one.asked = 0.6
    with pytest.raises(LimitExceeded, match="the device"):
        one.judge(1)
    assert one.asked is None
    assert one.allows(0.5)


def test_a_direct_goal_goes_out_as_it_is(axis: Any) -> None:
    one = place(axis, direct=True)
    assert led(one, STEP) == pytest.approx(STEP)
    assert led(one, 0.0) == pytest.approx(0.0)


def test_a_direct_goal_keeps_within_the_velocity_of_its_axis(axis: Any) -> None:
    one = place(axis, direct=True)
    one.asked = 1.01 * STEP
    with pytest.raises(
        LimitExceeded, match=r"a1: from 0.0 deg to 0.9 deg in 10 ms is 90.9 deg/s, and its limit is 90"
    ):
        one.judge(1)
    assert led(one, 1.9 * STEP, periods=2) == pytest.approx(1.9 * STEP)


def test_a_loop_that_was_held_up_does_not_allow_a_leap(axis: Any) -> None:
    one = place(axis, direct=True)
    one.asked = (CATCH_UP + 0.1) * STEP
    with pytest.raises(LimitExceeded, match="its limit is"):
        one.judge(1000)


@pytest.mark.parametrize("direct", [False, True])
def test_no_order_is_farther_from_the_measured_position_than_max_step(axis: Any, direct: bool) -> None:
    one = place(axis, direct=direct)

    def pushes() -> None:  # against something that holds the axis at 0
        for number in range(1, 100):
            one.asked = number * 0.9 * STEP if direct else 1.0
            one.judge(1)
            one.step(1)

    with pytest.raises(
        LimitExceeded, match=r"a1: the goal .* is, and one command may be 20.0 deg"
    ) as refused:
        pushes()
    assert ("it stays at its last goal" in refused.value.advice) == (not direct)
    assert one.sent is not None
    assert radians(19) < one.sent <= radians(20)
    assert one.asked == one.sent  # and there it stays
    one.judge(1)
    assert one.step(1) - pi == pytest.approx(one.sent)


@pytest.mark.parametrize("direct", [False, True])
def test_nor_than_where_its_goals_are_at_its_greatest_speed_with_all_that_it_may_lag(direct: bool) -> None:
    limits = {"low": "-90 deg", "high": "90 deg"}
    with machine(arm="1", axes={"a1": {"gear": 2.0, **limits}}) as (made, _), Robot.of(made) as robot:
        one = place(robot["a1"], direct=direct)
        most = LATE * radians(90) + NEAR / 2

        def pushes() -> None:
            for number in range(1, 200):
                one.asked = number * 0.9 * STEP if direct else 1.5
                one.judge(1)
                one.step(1)

        with pytest.raises(
            LimitExceeded, match=r"led at 90 deg/s at most is never ordered farther"
        ) as refused:
            pushes()
        assert refused.value.reason == "velocity"
        assert one.sent is not None
        assert most - STEP < one.sent <= most
        assert one.asked == one.sent


def test_a_short_hitch_is_made_good_and_a_long_one_begins_anew_at_rest(axis: Any) -> None:
    one = place(axis)
    for _ in range(40):
        before = led(one, 2.0)
    assert led(one, 2.0, CATCH_UP) - before == pytest.approx(CATCH_UP * STEP, rel=1e-6)
    before = one.position
    assert 0 < led(one, 2.0, 500) - before < STEP / 10


def test_braking_ends_at_the_follower_s_stopping_point(axis: Any) -> None:
    one = place(axis)
    for _ in range(40):
        here = led(one, 2.0)
    one.halt()
    assert one.asked == pytest.approx(here + radians(90) ** 2 / (2 * radians(360)), rel=1e-6)
    while not one.arrived:
        here = led(one, one.asked or 0.0)
    assert here == pytest.approx(one.asked)


def test_who_is_at_rest_when_all_brake_stays_whatever_was_asked(axis: Any) -> None:
    one = place(axis)
    one.asked = 2.0
    one.halt()
    assert one.arrived
    assert one.asked == 0.0
    assert one.step(1) == pytest.approx(pi)


def test_at_rest_it_goes_on_slowly_from_its_last_goal(axis: Any) -> None:
    one = place(axis)
    for _ in range(40):
        here = led(one, 2.0)
    assert one.stay() - pi == pytest.approx(here)
    one.rest()
    assert 0 < led(one, 2.0) - here < STEP / 10


def test_what_is_led_no_more_waits_for_a_goal(axis: Any) -> None:
    one = place(axis)
    led(one, 0.5)
    assert one.follows
    one.release()
    one.halt()  # and these do nothing
    one.rest()
    assert (one.asked, one.sent, one.begun, one.follows) == (None, None, False, False)


def test_a_direct_goal_is_never_braked(axis: Any) -> None:
    one = place(axis, direct=True)
    led(one, STEP)
    one.halt()
    one.rest()
    assert one.arrived
    assert one.sent == pytest.approx(STEP)


# -- who may be ordered --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rate", "endures"), [(800.0, 2), (100.0, 2), (6.1, 2), (5.0, 1), (3.9, 0), (1.0, 0)]
)
def test_nobody_is_ordered_by_a_position_that_is_old(axis: Any, rate: float, endures: int) -> None:
    one = Place(axis, None, 1 / rate, False)
    assert one.endures == endures
    assert (endures + 1) / rate <= FRESH or endures == 0
    one.silent = endures
    assert not one.unsure
    one.silent += 1
    assert one.unsure
    one.hear(pi, 1.0)
    assert not one.unsure


def test_who_is_doubted_is_not_ordered_until_it_is_heard(axis: Any) -> None:
    one = place(axis)
    one.doubt()
    assert (one.unsure, one.silent) == (True, 1)
    one.hear(pi + 0.1, 1.0)
    assert (one.unsure, one.silent) == (False, 0)
    assert one.position == pytest.approx(0.1)


def test_who_resumes_goes_on_at_rest_from_where_it_is(axis: Any) -> None:
    one = place(axis)
    for _ in range(60):
        led(one, 2.0)
    one.position = 0.1
    one.resume()
    assert one.sent == 0.1
    assert 0.1 < led(one, 2.0) < 0.1 + 0.1 * STEP


def test_with_clamp_a_goal_becomes_the_nearest_that_is_allowed(axis: Any) -> None:
    axis.departs()
    one = Place(axis, (pi - 0.5, pi + 0.5), PERIOD, False, "clamp")
    one.begin(0.0)
    one.asked = 9.0
    one.judge(1)
    assert one.asked == pytest.approx(0.5)
    one.judge(1)
    assert [(told.asked, told.reason) for told in one.clamps] == [(9.0, "limits")]


def test_a_direct_goal_that_no_place_is_near_to_is_refused_with_clamp_too(axis: Any) -> None:
    axis.departs()
    one = Place(axis, None, PERIOD, True, "clamp")
    one.begin(1.0)
    one.position = 0.0  # somebody has turned it away, and max_step is 20 degrees
    one.asked = 1.0
    with pytest.raises(LimitExceeded, match="one command may be"):
        one.judge(1)
    assert one.clamps == []


def test_a_direct_goal_is_judged_by_its_way_when_it_may_be_sent_again(axis: Any) -> None:
    one = place(axis, direct=True)
    one.silent = one.endures + 1
    one.asked = 10 * STEP
    one.judge(1)  # it is not sent now
    one.hear(pi, 1.0)
    with pytest.raises(LimitExceeded, match="its limit is 90 deg/s"):
        one.judge(1)
