"""An order that says no velocity runs at the speed of its device: it leads no farther than an axis is led."""

from __future__ import annotations

from math import pi, radians
from typing import Any

import pytest

from motorbus.errors import LimitExceeded
from motorbus.families.feetech import sync_write_positions
from motorbus.families.kst import BusSettings, broadcast_position
from motorbus.session.robot import Robot
from tests.support.machines import machine

SLOW = {"max_velocity": "5 deg/s"}
FAR_AND_BARE = "comes without a velocity, so its device would go there as fast as it can"


@pytest.mark.parametrize(
    "order",
    [
        lambda robot: robot["a1"].device.write(goal_position=pi + 0.7),
        lambda robot: robot.buses["arm"].run(sync_write_positions([robot["a1"].device], [pi - 0.7])),
        lambda robot: robot["a1"].device.reg_write(goal_position=pi + 0.7),
        lambda robot: robot["c1"].device.move(0.7, wait=False),
        lambda robot: robot["c1"].device.write(goal_position=-0.7),
        lambda robot: robot.buses["can"].run(broadcast_position(0.7, [0x26], BusSettings())),
    ],
    ids=["write", "sync_write", "reg_write", "kst move", "kst write", "broadcast"],
)
def test_an_order_without_a_velocity_leads_no_farther_than_an_axis_is_led(order: Any) -> None:
    with (
        machine(arm="1", can="0x25,0x26", axes={"a1": SLOW, "c1": SLOW}) as (made, sims),
        Robot.of(made) as robot,
    ):
        robot["a1"].enable_torque()
        robot.positions()
        before = sims["arm"][1].raw_position, sims["can"][0x25].raw_position
        with pytest.raises(LimitExceeded, match=FAR_AND_BARE) as caught:
            order(robot)
        assert caught.value.reason == "velocity"
        for axis in (robot["a1"], robot["c1"]):
            axis.bus.link.advance(0.3)
        assert (sims["arm"][1].raw_position, sims["can"][0x25].raw_position) == before


def test_one_that_says_a_velocity_may_lead_anywhere_within_the_limits() -> None:
    with machine(arm="1", axes={"a1": SLOW}) as (made, _), Robot.of(made) as robot:
        robot["a1"].device.move(pi + 0.7, velocity=radians(5), wait=False)
        robot["a1"].device.write(goal_position=pi + 0.1)
        robot["a1"].stop()
        robot["a1"].device.write(goal_position=pi + 0.7, goal_time=0, goal_velocity=radians(5))
        with pytest.raises(LimitExceeded, match=FAR_AND_BARE):  # in a time, it says itself how fast
            robot["a1"].device.write(goal_position=pi + 0.7, goal_time=1, goal_velocity=radians(5))


def test_a_slow_axis_that_has_no_speed_of_its_own_is_led_all_the_way() -> None:
    with machine(can="0x25", axes={"c1": SLOW}) as (made, _), Robot.of(made) as robot:
        robot["c1"].move(0.5)
        assert robot["c1"].position() == pytest.approx(0.5, abs=0.02)
