"""What was handed over is judged when it begins, whoever lets it begin, and by where the devices are then."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, radians
from typing import Any

import pytest

import motorbus
from motorbus.errors import LimitExceeded, Refused, RequestError
from motorbus.families.feetech import action_all, reg_write_all
from motorbus.families.kst import broadcast_position
from motorbus.families.kst.driver.dialect import Dialect
from motorbus.motion.machine import Machine
from motorbus.motion.safety.lease import Lease
from motorbus.session import prepare
from motorbus.session.robot import Robot
from tests.support.machines import listened, machine, said

STEP = {"a1": {"max_step": "15 deg"}}


def bus_of(robot: Robot, name: str = "arm") -> Any:
    return robot.buses[name]


def refused(robot: Robot, node: int | None = None) -> str:
    """Why ACTION from somebody who holds nothing is refused; "" where it passes."""
    bus = bus_of(robot)
    try:
        if node is None:
            bus.run(action_all())
        else:
            motorbus.feetech.Servo(bus, node).action()
    except Refused as error:
        return error.reason if "nothing was sent" in str(error) else "and something was sent"
    return ""


@pytest.mark.parametrize("node", [None, 1])
def test_action_at_fault_is_refused_whoever_holds_what_waits(node: int | None) -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot["a1"].device.reg_write(goal_position=pi + 0.2)
        bus_of(robot).admit.faults[1] = "it has lost its supply"
        assert refused(robot, node) == "fault"
        bus_of(robot).link.advance(2.0)
        assert sims["arm"][1].raw_position == 2048


@pytest.mark.parametrize("node", [None, 1])
def test_what_waits_is_judged_by_where_the_device_is_when_it_begins(node: int | None) -> None:
    with machine(arm="1", axes=STEP) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        device = robot["a1"].device
        device.reg_write(goal_position=pi + 0.2)
        for step in range(1, 6):
            device.move(pi - 0.2 * step, velocity=1.0)
        bus_of(robot).link.advance(5.0)  # what is known of it is stale by now, so it is looked at first
        listened(sims)
        assert refused(robot, node) == "step"
        assert not [frame for frame in said(sims) if "ACTION" in frame]
        for step in range(4, -1, -1):
            device.move(pi - 0.2 * step, velocity=1.0)
        assert refused(robot, node) == ""
        bus_of(robot).link.advance(1.0)
        assert sims["arm"][1].raw_position == 2048 + 130


@pytest.mark.parametrize("node", [None, 1])
def test_what_has_no_end_needs_who_attends_when_it_begins_and_goes_on_from_then(node: int | None) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        device, gate = robot["a1"].device, bus_of(robot).admit
        device.set_mode("velocity")
        device.enable_torque()
        with robot.attended():
            device.reg_write(goal_velocity=0.5)
        assert not gate.goes_on(1)
        assert refused(robot, node) == "unattended"
        with robot.attended():
            assert refused(robot, node) == ""
            assert gate.goes_on(1)
            bus_of(robot).link.advance(0.5)
            assert sims["arm"][1].status()["moving"]


@pytest.mark.parametrize("node", [None, 1])
def test_what_nobody_knows_is_not_let_begin_where_bounds_are_set(node: int | None) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        assert refused(robot, node) == "unknown"
        robot["a1"].device.reg_write(goal_position=pi + 0.1, goal_time=0, goal_velocity=1.0)
        assert refused(robot, node) == ""
        assert refused(robot, node) == "unknown"
        assert len([frame for frame in said(sims) if "ACTION" in frame]) == 1


def test_without_bounds_action_passes_as_ever() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        bus.run(action_all())
        motorbus.feetech.Servo(bus, 1).action()


def test_what_was_handed_over_before_a_stop_does_not_begin_after_it() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        robot["a1"].device.reg_write(goal_position=pi + 0.1)
        robot["a1"].disable_torque()
        robot["a1"].enable_torque()
        assert refused(robot) == refused(robot, 1) == "stopped"
        robot["a1"].device.reg_write(goal_position=pi + 0.1)
        assert refused(robot) == ""


def test_without_the_lease_nothing_that_waits_begins() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        robot["a1"].device.reg_write(goal_position=pi + 0.1)
        bus_of(robot).admit.lease = Lease(0.5)
        assert refused(robot) == refused(robot, 1) == "lease"
        bus_of(robot).admit.lease = None


def test_several_begin_together_and_all_or_none_of_them() -> None:
    with machine(arm="1-3", axes=STEP) as (made, sims), Robot.of(made) as robot:
        devices = [robot[name].device for name in ("a1", "a2")]
        bus = bus_of(robot)
        near = {device: {"goal_position": pi + 0.2} for device in devices}
        bus.run(reg_write_all(near))
        bus.link.advance(2.0)
        assert [sims["arm"][node].raw_position for node in (1, 2, 3)] == [2178, 2178, 2048]
        with pytest.raises(LimitExceeded):
            bus.run(reg_write_all({device: {"goal_position": pi - 0.2} for device in reversed(devices)}))
        assert refused(robot) == ""  # what the other one held was taken back
        bus.link.advance(2.0)
        assert [sims["arm"][node].raw_position for node in (1, 2, 3)] == [2178, 2178, 2048]


def test_bounds_that_do_not_allow_a_place_do_not_do_so_when_it_is_the_only_one_of_its_device() -> None:
    with (
        machine(arm="1", axes={"a1": {"low": "-20 deg", "high": "20 deg"}}) as (made, sims),
        Robot.of(made) as robot,
    ):
        device = robot["a1"].device
        device.write(min_position_limit=pi + 1, max_position_limit=pi + 1)
        listened(sims)
        orders: list[Callable[[], object]] = [
            lambda: device.move(pi + 1, velocity=1.0, wait=False),
            lambda: device.write(goal_position=pi + 1),
            lambda: device.reg_write(goal_position=pi + 1),
        ]
        for order in orders:
            with pytest.raises(LimitExceeded, match="outside -20.0 deg to 20.0 deg"):
                order()
        with pytest.raises(LimitExceeded, match="outside -20.0 deg to 20.0 deg"):
            device.enable_torque(jump=2.0)
        bus_of(robot).link.advance(2.0)
        assert sims["arm"][1].raw_position == 2048


def test_torque_comes_on_neither_at_fault_nor_without_the_lease_and_stopping_goes_on() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        device, gate = robot["a1"].device, bus_of(robot).admit
        device.set_mode("step")
        for reason in ("fault", "lease"):
            gate.faults.update({1: "it has lost its supply"} if reason == "fault" else {})
            gate.lease = Lease(0.5) if reason == "lease" else None
            for mode in ("step", "position"):
                device.set_mode(mode)
                with pytest.raises(Refused) as caught:
                    device.enable_torque()
                assert caught.value.reason == reason
                assert sims["arm"][1].memory["torque_enable"] == 0
            device.stop()
            device.disable_torque()
            gate.faults.clear()
        gate.lease = None


def test_of_many_packets_none_leaves_when_the_last_is_refused() -> None:
    narrow = {"a90": {"low": "-5 deg", "high": "5 deg"}}
    with machine(arm="1-90", axes=narrow) as (made, sims), Robot.of(made) as robot:
        devices = [robot[f"a{node}"].device for node in range(1, 91)]
        listened(sims)
        with pytest.raises(LimitExceeded, match="a90: 17.2 deg is outside"):
            bus_of(robot).run(
                motorbus.feetech.sync_write({one: {"goal_position": pi + 0.3} for one in devices})
            )
        assert not [frame for frame in said(sims) if "WRITE" in frame]
        bus_of(robot).run(
            motorbus.feetech.sync_write({one: {"goal_position": pi + radians(4)} for one in devices})
        )
        assert len([frame for frame in said(sims) if "WRITE" in frame]) == 2


def test_everybody_is_not_moved_while_one_that_was_not_named_is_at_fault() -> None:
    with machine(can="0x25,0x26") as (made, sims), Robot.of(made) as robot:
        robot.positions()
        bus_of(robot, "can").admit.faults[0x26] = "it has lost its supply"
        listened(sims)
        with pytest.raises(Refused, match="node 38 is at fault") as caught:
            bus_of(robot, "can").run(broadcast_position(0.05, [0x25]))
        assert caught.value.reason == "fault"
        assert not [frame for frame in said(sims) if "goal" in frame]


STARTED = """
format = 1
[bus.can]
address = "{url},profile=xqpower"
[axis.c1]
device = "can#0x25"
low = "-30 deg"
high = "30 deg"
unit = "deg"
max_velocity = "90 deg/s"
max_acceleration = "360 deg/s2"
"""


@pytest.mark.parametrize(("fault", "to"), [("it has lost its supply", 0.05), ("", 1.0)])
def test_a_servo_that_must_be_started_is_not_started_for_what_is_refused(fault: str, to: float) -> None:
    with motorbus.simulate("kst", ids="0x25", profile="xqpower") as sim:
        made = Machine.parse(STARTED.format(url=sim.url), check_address=lambda address: prepare(address, {}))
        with Robot.of(made) as robot:
            bus, device = bus_of(robot, "can"), robot["c1"].device
            bus.admit.faults.update({0x25: fault} if fault else {})
            device.position()
            everyone = Dialect("xqpower")
            orders: list[Callable[[], object]] = [
                lambda: device.move(to),
                lambda: bus.run(broadcast_position(to, [0x25], everyone)),
            ]
            for order in orders:
                listened({"can": sim})
                with pytest.raises(Refused):
                    order()
                assert not [frame for frame in said({"can": sim}) if "start" in frame or "goal" in frame]


def test_taken_for_granted_is_nothing_of_a_servo_that_refuses_by_itself() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        device = robot["a1"].device
        device.reg_write(goal_position=pi + 0.1)
        device.disable_torque()
        with pytest.raises(RequestError, match="told to let go after its REG WRITE"):
            device.action()
