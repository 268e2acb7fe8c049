"""A fence stands on every bus that has a gate, around every axis of the file, opened or not, and knows who reckons."""

from __future__ import annotations

from math import inf
from typing import Any

import msgspec
import pytest

import motorbus
from motorbus.core.family import Readdressed
from motorbus.core.operation import Goal
from motorbus.errors import LimitExceeded
from motorbus.motion.reckoning import UNDER_WAY, Reckoning
from motorbus.motion.safety.fence import bounds, enclose, fence, follow, guard
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Guard
from motorbus.session.robot import Robot
from tests.motion.machines import machine


def gate_of(robot: Any, bus: str) -> Gate:
    gate = robot.buses[bus].admit
    assert isinstance(gate, Gate)
    return gate


def reckoning_of(axis: Any) -> Reckoning:
    reckoning = axis.reckoning
    assert isinstance(reckoning, Reckoning)
    return reckoning


def goes(one: Guard, way: float) -> bool:
    try:
        one.check_goal(Goal(1, "relative", way, -inf, inf), paced=True)
    except LimitExceeded:
        return False
    return True


def test_endless_motion_is_to_be_attended_on_every_bus_by_the_time_of_the_robot() -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        for name in ("arm", "can", "stage"):
            gate = gate_of(robot, name)
            assert gate.attended
            assert gate.origin == robot.origins[name]
            assert robot.buses[name].turns.look == gate.look


def test_a_bus_that_was_gone_makes_its_own_axes_unknown_and_no_others() -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        reckoning = reckoning_of(robot["lift"])
        reckoning.declare(0.1)
        robot.positions()
        known = gate_of(robot, "can").guards[0x25].track
        assert known is not None
        known.take(0.0, robot.now)
        for tell in robot.buses["can"].turns.anew:
            tell()
        seen = {name: robot[name].track.sample is not None for name in ("a1", "a2", "c1")}
        assert seen == {"a1": True, "a2": True, "c1": False}
        assert known.sample is None
        assert reckoning.position == 0.1
        for tell in robot.buses["stage"].turns.anew:
            tell()
        assert reckoning.position is None


def test_a_bus_without_a_gate_of_ours_is_left_as_it_is() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        bus = robot.buses["arm"]
        anew = bus.turns.anew
        bus.admit = None
        enclose(bus, {"a1": robot["a1"].spec})
        fence(robot)
        assert bus.turns.anew is anew


def test_an_id_that_cannot_be_bounds_nobody_and_hinders_no_other() -> None:
    with machine(arm="1") as (made, _), motorbus.simulate("feetech", ids="1-2") as sim:
        spec = made.axes["a1"]
        axes = {
            name: msgspec.structs.replace(spec, device=f"arm#{node}")
            for name, node in (("one", 1), ("nobody", 999), ("other", 2))
        }
        with motorbus.open(sim.url) as bus:
            enclose(bus, axes)
            assert isinstance(bus.admit, Gate)
            assert {node: one.name for node, one in bus.admit.guards.items()} == {1: "one", 2: "other"}
            assert all(one.ask is not None and one.track is not None for one in bus.admit.guards.values())


def test_without_limits_in_the_file_those_of_the_device_hold_alone() -> None:
    with machine(arm="1", axes={"a1": {"low": None, "high": None}}) as (made, _):
        assert bounds(made.axes["a1"])[:2] == (-inf, inf)


def test_a_device_of_another_id_is_asked_there_where_it_tells_and_else_not() -> None:
    with machine(arm="1", lift=True) as (made, _), Robot.of(made) as robot:
        for name, tells in (("arm", True), ("stage", False)):
            gate = gate_of(robot, name)
            follow(robot.buses[name], gate, Readdressed(1, 9))
            moved = gate.guards[9]
            assert (moved.name, moved.bounds) == (gate.guards[1].name, gate.guards[1].bounds)
            assert (moved.ask is not None) is tells
            assert (moved.track is not None) is tells


def test_where_nobody_knows_which_device_it_is_any_fault_counts_and_the_first_bounds() -> None:
    with machine(arm="1-3") as (made, _), Robot.of(made) as robot:
        gate = gate_of(robot, "arm")
        gate.faults[2] = "it was seen to smoke"
        follow(robot.buses["arm"], gate, Readdressed(None, 9))
        assert gate.guards[9].name == "a1"
        assert gate.faults == {2: "it was seen to smoke", 9: "it was seen to smoke"}


def test_a_way_of_one_that_is_reckoned_begins_where_it_is_or_was_when_it_left() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        axis = robot["lift"]
        one, reckoning = guard(axis), reckoning_of(axis)
        full = axis.spec.to_device(0.2) - axis.spec.to_device(0.0)
        assert goes(one, full * 0.99)
        assert not goes(one, full * 1.01), "nobody knows where it is, but so much it cannot go"
        reckoning.declare(0.15)
        assert goes(one, full * 0.24)
        assert not goes(one, full * 0.26)
        reckoning.depart()
        assert goes(one, full * 0.24)
        assert not goes(one, full * 0.26), "it is on its way from there"


@pytest.mark.parametrize("under_way", [True, False])
def test_who_reckons_knows_no_place_after_an_order_of_somebody_else(under_way: bool) -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        reckoning = reckoning_of(robot["lift"])
        reckoning.declare(0.15)
        if under_way:
            reckoning.depart()
        gate_of(robot, "stage").guards[1].leaves()
        assert (reckoning.departed, reckoning.why == UNDER_WAY) == (0.15 if under_way else None, under_way)
        assert under_way or "and not as an axis" in reckoning.why
        assert reckoning.position is None


def test_torque_alone_ends_no_movement_that_is_under_way() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis, told = robot["a1"], gate_of(robot, "arm").guards[1].ordered
        for moves, under_way in ((False, False), (True, True), (False, True)):
            told(moves)
            assert (axis.engaged, axis.under_way) == (True, under_way)
