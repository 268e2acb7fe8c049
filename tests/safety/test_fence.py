"""What a machine file says holds for every order on its buses, whoever gives it and in whatever spelling."""

from __future__ import annotations

from math import inf, pi, radians
from typing import Any

import pytest

from motorbus.core.family import IdChanged
from motorbus.core.request import Effect, Request, Response
from motorbus.core.setpoint import Setpoint
from motorbus.errors import LimitExceeded, NoReply, Refused
from motorbus.families.feetech import ServoGroup
from motorbus.motion.safety.fence import bounds, follow
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds
from motorbus.motion.safety.lease import Lease
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import listened, machine, said

STEP = {"max_step": "10 deg"}
DOWN = {"sign": -1, "gear": 2.0, "low": "-40 deg", "high": "20 deg", "max_step": "4 deg"}


def gate_of(robot: Any, bus: str = "arm") -> Gate:
    gate = robot.buses[bus].interlock
    assert isinstance(gate, Gate)
    return gate


def test_bounds_are_in_angles_of_the_device() -> None:
    with machine(arm="1-2", axes={"a2": DOWN}) as (made, _), Robot.of(made) as robot:
        assert bounds(robot["a1"].spec) == pytest.approx(
            Bounds(pi - radians(150), pi + radians(150), inf, radians(90))
        )
        assert bounds(robot["a2"].spec) == pytest.approx(
            Bounds(pi - radians(40), pi + radians(80), radians(8), radians(180))
        )
        assert gate_of(robot).guards.keys() == {1, 2}


def test_a_stepper_has_a_guard_that_knows_no_position() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        assert gate_of(robot, "stage").guards[1].track is None


@pytest.mark.parametrize("to", [pi - radians(151), pi + radians(151)])
def test_an_order_to_the_device_itself_keeps_the_soft_limits(to: float) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        robot["a1"].enable_torque()
        listened(sims)
        beyond = r"a1: .*15.* deg is outside -150.0 deg to 150.0 deg"
        with pytest.raises(LimitExceeded, match=beyond):
            robot["a1"].device.move(to, velocity=1.0)
        with pytest.raises(LimitExceeded, match=beyond):
            robot["a1"].device.write(goal_position=to)
        assert not [frame for frame in said(sims) if "WRITE" in frame]


def test_the_bus_looks_first_where_it_is_and_then_gives_the_order() -> None:
    with machine(arm="1", axes={"a1": STEP}) as (made, sims), Robot.of(made) as robot:
        listened(sims)
        robot["a1"].device.move(pi + 0.1, velocity=1.0)
        frames = said(sims)
        first = next(index for index, frame in enumerate(frames) if frame.startswith("WRITE"))
        assert frames[first - 1].startswith("READ")
        with pytest.raises(LimitExceeded, match="one command may be 0.1745 rad"):
            robot["a1"].device.move(pi + 0.5, velocity=1.0)


def test_as_fast_as_it_can_is_faster_than_the_axis_may_be() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        with pytest.raises(LimitExceeded, match=r"a1: 5.2\d+ rad/s of its device is above 1.571 rad/s"):
            robot["a1"].device.move(pi + 0.1)
        robot["a1"].device.move(pi + 0.1, velocity=1.5)


def test_an_axis_that_is_silent_is_not_moved_and_says_why() -> None:
    with machine(can="0x25") as (made, sims), Robot.of(made) as robot:
        axis = robot["c1"]
        axis.device.move(0.05)
        sims["can"][0x25].unplug()
        axis.bus.link.advance(axis.bus.link.now() + 2.0)
        listened(sims)
        with pytest.raises(NoReply, match="node 37 did not answer"):
            axis.device.move(0.1)
        assert not [frame for frame in said(sims) if "goal" in frame]
        sims["can"][0x25].plug()


def test_an_order_that_was_kept_is_looked_after_too_and_refused_once_nobody_answers() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.enable_torque()
        kept = ServoGroup([axis.device]).write("goal_position")([pi + 0.1])
        axis.bus.run(kept)
        axis.bus.link.advance(2.0)
        axis.bus.run(kept)
        sims["arm"][1].unplug()
        axis.bus.link.advance(2.0)
        listened(sims)
        with pytest.raises(Refused, match=r"a1: where it is was read 2\.\d* s ago") as caught:
            axis.bus.run(kept)
        assert caught.value.reason == "stale"
        assert not [frame for frame in said(sims) if "WRITE" in frame]
        sims["arm"][1].plug()


def test_a_device_that_has_jumped_is_looked_at_twice_and_then_moved_from_there() -> None:
    with machine(arm="1", axes={"a1": STEP}) as (made, sims), Robot.of(made) as robot:
        robot["a1"].position()
        sims["arm"][1].raw_position = 3000
        robot["a1"].position()
        there = robot["a1"].device.position()
        listened(sims)
        robot["a1"].device.move(there + 0.05, velocity=1.0, wait=False)
        assert any(frame.startswith("WRITE") for frame in said(sims))


def test_stopping_holding_and_letting_go_pass_whatever_is_not_known() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        for bus in ("arm", "can"):
            gate = gate_of(robot, bus)
            gate.faults.update(dict.fromkeys(gate.guards, "it has lost its supply"))
        robot.stop()
        robot["a1"].disable_torque()
        with pytest.raises(Refused, match="node 37 is at fault: it has lost its supply") as caught:
            robot["c1"].device.move(0.1)
        assert caught.value.reason == "fault"


async def _moves() -> None:
    with machine(arm="1") as (made, _):
        async with AsyncRobot.of(made) as robot:
            assert gate_of(robot).guards.keys() == {1}
            await robot["a1"].device.move(pi + 0.1, velocity=1.0)
            with pytest.raises(LimitExceeded, match="outside"):
                await robot["a1"].device.move(pi + 2.9, velocity=1.0)


def test_the_same_holds_on_an_event_loop() -> None:
    import asyncio

    asyncio.run(_moves())


def test_axes_of_the_file_that_were_not_opened_are_guarded_too() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made, "a1") as robot:
        other = robot.buses["arm"].family.devices.blocking(robot.buses["arm"], 2)
        other.enable_torque()
        with pytest.raises(LimitExceeded, match="a2"):
            other.move(pi + 3.0, velocity=1.0)
        assert sims["arm"][2].raw_position == 2048
        other.move(pi + 0.1, velocity=1.0)


@pytest.mark.parametrize("exit_", ["torque_off", "hold"])
def test_what_was_ordered_by_itself_is_left_as_the_file_says(exit_: str) -> None:
    with machine(arm="1", exit=exit_) as (made, sims):
        with Robot.of(made) as robot:
            assert not robot["a1"].engaged
            robot["a1"].device.enable_torque()
            assert (robot["a1"].engaged, robot["a1"].under_way) == (True, False)
            robot["a1"].device.move(pi + 1.0, velocity=0.2, wait=False)
            assert robot["a1"].under_way
        assert bool(sims["arm"][1].memory["torque_enable"]) == (exit_ == "hold")
        at = sims["arm"][1].raw_position
        assert at < 2048 + 100
        assert abs(sims["arm"][1].memory["goal_position"] - at) < 20


def test_what_was_refused_or_only_tried_out_engages_nothing() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        with pytest.raises(LimitExceeded):
            axis.device.write(goal_position=pi + 3.0)
        gate_of(robot).lease = Lease()
        with pytest.raises(Refused):
            axis.device.enable_torque()
        robot.lease = None
        assert (axis.engaged, axis.under_way) == (False, False)
        order = Setpoint(1, "position", pi + 0.1, 0.0, 6.0)
        axis.position()
        speed = Setpoint(1, "speed", 1.0, 0.0, 9.0)
        request: Request[Response] = Request(b"\x01", effect=Effect.MOTION, setpoints=(order, speed))
        gate_of(robot).rehearsing()(request)
        assert (axis.engaged, axis.under_way) == (False, False)
        gate_of(robot)(request)
        assert (axis.engaged, axis.under_way) == (True, True)


def test_the_guard_goes_along_with_a_device_that_gets_another_id() -> None:
    narrow = {"a1": {"low": "-20 deg", "high": "20 deg"}}
    with machine(arm="1", axes=narrow) as (made, sims), Robot.of(made) as robot:
        bus, sim = robot.buses["arm"], sims["arm"][1]
        robot["a1"].device.set_id(7)
        found = bus.family.devices.blocking(bus, 7)
        found.enable_torque()
        with pytest.raises(LimitExceeded, match="a1: .* is outside -20.0 deg to 20.0 deg"):
            found.move(pi + 1.0, velocity=1.0)
        found.move(pi + 0.1, velocity=1.0)
        assert sim.raw_position == pytest.approx(2048 + 65, abs=3)


def test_the_fault_goes_along_too_and_bounds_that_the_file_has_for_the_new_id_count() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        bus, gate = robot.buses["arm"], gate_of(robot)
        own = gate.guards[2]
        gate.faults[1] = "it was seen to smoke"
        for old, new in ((1, 2), (1, 9), (None, 8), (77, 78)):
            follow(bus, gate, IdChanged(old, new))
        assert gate.guards[2] is own
        assert [gate.guards[node].name for node in (8, 9)] == ["a1", "a1"]
        assert gate.guards.keys() == {1, 2, 8, 9}
        assert gate.faults.keys() == {1, 2, 8, 9}


def test_what_a_servo_is_told_by_the_id_it_is_going_to_have_is_bounded_on_can_too() -> None:
    with machine(can="0x25") as (made, _), Robot.of(made) as robot:
        robot["c1"].device.set_node_id(0x30)
        assert gate_of(robot, "can").guards[0x30].name == "c1"
