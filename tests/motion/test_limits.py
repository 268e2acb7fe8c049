"""Every motion is judged in one place: what goes too far is refused, and told in the unit of the axis."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import inf, nan, pi, radians
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion import limits
from motorbus.motion.machine import AxisSpec
from motorbus.motion.trajectory import Trajectory
from motorbus.session.robot import Robot
from tests.support.machines import listened, machine, said

SHOULDER = AxisSpec(
    device="arm#1",
    unit="deg",
    zero=pi,
    sign=-1,
    gear=2.0,
    low=radians(-90),
    high=radians(45),
    max_velocity=1.0,
    max_acceleration=4.0,
    max_step=radians(10),
)
SLIDE = AxisSpec(device="stage#1", unit="mm", travel=0.005, max_velocity=0.02, max_acceleration=0.1)


def refused(*args: object, **kwargs: object) -> str:
    with pytest.raises(LimitExceeded) as told:
        limits.check_goal(*args, **kwargs)  # type: ignore[arg-type]
    assert "nothing was sent" in str(told.value)
    return str(told.value)


def test_a_goal_within_the_soft_limits_is_allowed_to_the_last_digit() -> None:
    for goal in (SHOULDER.low, 0.0, SHOULDER.high):
        assert goal is not None
        limits.check_goal("shoulder", SHOULDER, goal)
        limits.check_goal("shoulder", SHOULDER, SHOULDER.from_device(SHOULDER.to_device(goal)))


@pytest.mark.parametrize("goal", [radians(45.01), radians(-90.01), 100.0])
def test_a_goal_beyond_them_is_refused_in_degrees(goal: float) -> None:
    said = refused("shoulder", SHOULDER, goal)
    assert said.startswith(f"shoulder: the goal {SHOULDER.show(goal)} is outside -90.0 deg to 45.0 deg")
    assert "low and high of the axis" in said


@pytest.mark.parametrize("goal", [nan, inf, -inf])
def test_what_is_no_number_is_refused(goal: float) -> None:
    assert f"shoulder: its goal is {goal}" in refused("shoulder", SHOULDER, goal)


def test_the_devices_own_limits_hold_too_converted_to_the_axis() -> None:
    # sign -1, gear 2, zero 180 degrees: 120 to 240 degrees of the device are 30 to -30 of the axis
    device = radians(120), radians(240)
    assert limits.bounds(SHOULDER, device)[:2] == pytest.approx((radians(-30), radians(30)))
    limits.check_goal("shoulder", SHOULDER, radians(30), device=device)
    said = refused("shoulder", SHOULDER, radians(31), device=device)
    assert "-30.0 deg to 30.0 deg" in said
    assert "limit registers of the device" in said


def test_limits_of_the_device_that_are_wider_change_nothing() -> None:
    assert limits.bounds(SHOULDER, (-100.0, 100.0)).whose == "the soft limits"
    assert "the machine file" in refused("shoulder", SHOULDER, radians(46), device=(-100.0, 100.0))


def test_without_soft_limits_those_of_the_device_hold_alone() -> None:
    assert limits.bounds(SLIDE) == (-inf, inf, "the soft limits")
    limits.check_goal("slide", SLIDE, 5.0)
    said = refused("slide", SLIDE, 0.011, device=(0.0, 2 * 2 * pi))
    assert "0.00 mm to 10.00 mm, the limits of the device" in said


def test_a_goal_farther_than_one_step_from_where_the_axis_is_measured_is_refused() -> None:
    limits.check_goal("shoulder", SHOULDER, radians(10), measured=0.0)
    said = refused("shoulder", SHOULDER, radians(11), measured=0.0)
    assert "11.0 deg from 0.0 deg" in said
    assert "max_step" in said
    limits.check_step("slide", SLIDE, 100.0, 0.0)  # it has no such limit


def test_velocity_and_acceleration_are_bounded_in_both_directions() -> None:
    limits.check_velocity("shoulder", SHOULDER, -1.0)
    limits.check_acceleration("shoulder", SHOULDER, 4.0)
    with pytest.raises(LimitExceeded, match=r"the velocity 68\.7549 deg/s is above 57\.2958 deg/s"):
        limits.check_velocity("shoulder", SHOULDER, -1.2)
    with pytest.raises(LimitExceeded, match="the acceleration 200 mm/s² is above 100 mm/s², its limit"):
        limits.check_acceleration("slide", SLIDE, 0.2)
    with pytest.raises(LimitExceeded, match="its velocity is nan"):
        limits.check_velocity("slide", SLIDE, nan)


def test_a_profile_keeps_within_what_was_asked_for_and_speed_makes_time_longer() -> None:
    assert limits.limits_for("shoulder", SHOULDER) == (1.0, 4.0, None)
    assert limits.limits_for("shoulder", SHOULDER, speed=0.5) == (0.5, 1.0, None)
    assert limits.limits_for("shoulder", SHOULDER, velocity=0.2, acceleration=3.0) == (0.2, 3.0, None)


@pytest.mark.parametrize("speed", [0.0, -1.0, 1.01, nan, inf])
def test_a_speed_that_is_no_share_is_refused(speed: float) -> None:
    with pytest.raises(RequestError, match="speed is"):
        limits.limits_for("shoulder", SHOULDER, speed=speed)


@pytest.mark.parametrize("figure", [0.0, -1.0, nan])
def test_a_velocity_that_is_none_is_refused(figure: float) -> None:
    with pytest.raises(RequestError, match="shoulder: velocity is"):
        limits.limits_for("shoulder", SHOULDER, velocity=figure)
    with pytest.raises(RequestError, match="shoulder: acceleration is"):
        limits.limits_for("shoulder", SHOULDER, acceleration=figure)


def test_a_trajectory_is_judged_by_its_samples_and_by_the_device() -> None:
    calm = Trajectory([0.0, 1.0, 2.0, 3.0], {"shoulder": [0.0, 0.1, 0.4, 0.5]})
    limits.check_course(calm, {"shoulder": SHOULDER})
    with pytest.raises(LimitExceeded, match="limits of the axis and its device"):
        limits.check_course(calm, {"shoulder": SHOULDER}, {"shoulder": (pi - 0.9, pi + 0.9)})
    with pytest.raises(LimitExceeded, match="acceleration"):
        limits.check_course(calm.scaled(0.2), {"shoulder": SHOULDER})


def test_a_device_is_asked_for_its_limits_and_one_without_has_none() -> None:
    with machine(arm="1", lift=True) as (made, _), Robot.of(made) as robot:
        arm = robot["a1"].bus.run(limits.of_device(robot["a1"]))
        assert arm is not None
        assert arm == pytest.approx((0.0, radians(360)), abs=0.002)
        assert robot["lift"].bus.run(limits.of_device(robot["lift"])) is None


@pytest.mark.parametrize("value", ["1", None, True, b"1", [1.0], 10**400])
def test_what_is_no_number_is_one_error_of_the_request(value: object) -> None:
    with machine(arm="1", lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.1)
        arm, lift = robot["a1"], robot["lift"]
        listened(sims)
        figure: Any = value
        orders: list[Callable[[], object]] = [
            lambda: arm.move(figure),
            lambda: arm.move_by(figure),
            lambda: arm.jog(figure, 1.0),
            lambda: arm.jog(0.1, figure),
            lambda: lift.move_by(figure),
            lambda: lift.jog(0.01, figure),
            lambda: lift.declare(figure),
            lambda: robot.move({"a1": figure}),
            lambda: robot.move({"a1": 0.1}, speed=figure),
        ]
        if value is not None:
            orders += [
                lambda: arm.move(0.1, velocity=figure),
                lambda: arm.move(0.1, acceleration=figure),
                lambda: lift.move_by(0.01, velocity=figure),
                lambda: robot.move({"a1": 0.1}, duration=figure),
            ]
        for order in orders:
            with pytest.raises(RequestError, match="expected: a number"):
                order()
        assert said(sims) == []
        assert lift.estimated == 0.1


def test_a_number_of_another_library_is_one() -> None:
    third: Any = Fraction(1, 3)
    limits.check_number("its goal", third)
    assert limits.limits_for("shoulder", SHOULDER, velocity=third).velocity == third
