"""The gate: each check as rows of a table; then random calls, of which no goal outside the limits leaves."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import Any

import pytest

from motorbus.core.family import IdChanged
from motorbus.core.request import EVERY_LANE, Effect, Priority, Request
from motorbus.core.setpoint import Deferred, Setpoint, Stays
from motorbus.errors import LimitExceeded, MotorbusError, NotHomed, Refused
from motorbus.motion.axis import AxisStatus
from motorbus.motion.gate import Lease, SafetyGate, check_owned
from motorbus.motion.machine import AxisConfig, Position, Velocity

NOW = 100.0


class Bus:
    """What a gate needs of a bus."""

    def __init__(self) -> None:
        self.interlock: Any = None
        self.on_id_change: Any = None
        self.positions: dict[int, Any] = {}
        self.on_reconnect: Any = None
        self.stops = 0

    def now(self) -> float:
        return NOW

    def stop_count(self, node: int | None = None) -> int:
        return self.stops


def make(**keys: Any) -> tuple[SafetyGate, AxisStatus]:
    """A gate of one axis, node 1, from -1 to 1 rad, 1 rad/s, at 0.5 rad."""
    usual = {"low": Position(-1, "position"), "high": Position(1, "position")}
    config = AxisConfig(device="b#1", max_velocity=Velocity(1.0, "velocity"), **{**usual, **keys})
    axis = AxisStatus("a", config)
    axis.position, axis.at = 0.5, NOW
    return SafetyGate(Bus(), [axis]), axis  # type: ignore[arg-type]


def goal(value: float, quantity: str = "position", stays: Stays | None = None, **other: Any) -> Request[Any]:
    """A request with a setpoint for node 1, and a speed."""
    low, high = other.pop("ends", (None, None))
    setpoints: tuple[Setpoint, ...] = (Setpoint(other.pop("node", 1), quantity, value, low, high, stays),)
    if "speed" in other:
        setpoints += (Setpoint(1, "speed", other.pop("speed")),)
    return Request(b"x", effect=other.pop("effect", Effect.MOTION), setpoints=setpoints, **other)


def no_limits() -> dict[str, Any]:
    """An axis without limits."""
    return {"low": None, "high": None}


def at(gate: SafetyGate, axis: AxisStatus, **values: Any) -> None:
    """Change what is known of an axis."""
    for name, value in values.items():
        setattr(axis, name, value)


STEP = {"max_step": Position(0.2, "position")}
TABLE: list[tuple[dict[str, Any], dict[str, Any], Request[Any], str]] = [
    # keys of the axis, what is known of it, request, reason ("" passes)
    ({}, {}, goal(0.9), ""),
    ({}, {}, goal(1.0026), ""),  # the next count of the device
    ({}, {}, goal(1.01), "limits"),
    ({}, {}, goal(-1.01, speed=1.0), "limits"),
    ({}, {}, goal(nan), "limits"),
    ({}, {}, goal(inf), "limits"),
    ({}, {}, goal(0.7, ends=(0.0, 0.6)), "limits"),
    ({}, {"position": 2.0}, goal(1.8), ""),  # back towards the limits
    ({}, {"position": 2.0}, goal(2.1), "limits"),
    ({}, {"position": -2.0}, goal(-1.9), ""),
    ({}, {"position": -2.0}, goal(1.9, speed=1.0), "limits"),
    ({}, {}, goal(-0.41), "step"),
    ({}, {}, goal(-0.39), ""),
    ({}, {}, goal(-0.9, speed=1.0), ""),
    (STEP, {}, goal(0.71, speed=1.0), "step"),
    (STEP, {}, goal(0.69, speed=1.0), ""),
    ({}, {}, goal(0.6, speed=1.0), ""),
    ({}, {}, goal(0.6, speed=1.08), ""),  # one unit of the device above it
    ({}, {}, goal(0.6, speed=1.2), "velocity"),
    ({}, {}, goal(0.6, speed=nan), "limits"),
    ({}, {"at": NOW - 0.6}, goal(0.6), "stale"),
    ({}, {"at": NOW - 0.4}, goal(0.6), ""),
    ({}, {"suspect": 0.9}, goal(0.6), "suspect"),
    ({}, {"fault": "restart"}, goal(0.6), "fault"),
    ({}, {"fault": "restart"}, goal(1.0, "torque", Stays.ON, effect=Effect.TORQUE), "fault"),
    ({}, {"fault": "restart"}, goal(0.0, "torque", Stays.STILL, effect=Effect.TORQUE), ""),
    ({}, {"fault": "restart", "at": -inf}, goal(9.0, stays=Stays.STILL), ""),
    ({}, {"fault": "restart"}, goal(9.0, priority=Priority.STOP), ""),
    ({}, {"at": -inf}, goal(1.0, "torque", Stays.ON, effect=Effect.TORQUE), ""),
    ({}, {}, goal(0.5, "velocity"), "unattended"),
    ({}, {}, goal(0.0, "velocity"), ""),
    ({}, {}, goal(0.5, "load"), "unattended"),
    ({}, {}, goal(0.5, "current"), "unattended"),
    ({}, {}, goal(0.4, "relative"), ""),
    ({}, {}, goal(0.6, "relative"), "limits"),
    ({}, {"position": None, "measured": False}, goal(0.1, "relative"), "homed"),
    (no_limits(), {"position": None, "measured": False}, goal(9.0, "relative"), ""),
    ({}, {"position": None, "measured": False, "estimate": 0.9}, goal(0.2, "relative"), "limits"),
    ({}, {"position": None, "measured": False, "estimate": 0.9}, goal(-0.2, "relative"), ""),
    ({}, {}, goal(0.0, lane=EVERY_LANE), "limits"),
    ({}, {}, goal(0.0, lane=EVERY_LANE, stays=Stays.STILL), ""),
    ({}, {}, goal(3.0, node=2, ends=(0.0, 4.0)), ""),
    ({}, {}, goal(5.0, node=2, ends=(0.0, 4.0)), "limits"),
    ({}, {}, goal(3.0, node=2), "limits"),
    ({}, {}, Request(b"x", effect=Effect.MOTION), "limits"),
    ({}, {}, Request(b"x", effect=Effect.PERSISTENT), ""),
    ({}, {}, goal(0.6, deferred=Deferred(None, begins=True)), "stale"),
]


@pytest.mark.parametrize("row", range(len(TABLE)))
def test_checks(row: int) -> None:
    keys, known, request, reason = TABLE[row]
    gate, axis = make(**keys)
    at(gate, axis, **known)
    if not reason:
        gate.check(request, NOW)
        return
    with pytest.raises(MotorbusError) as caught:
        gate.check(request, NOW)
    assert getattr(caught.value, "reason", "homed") == reason
    assert not axis.moving


def test_all_setpoints_are_judged_before_one_counts() -> None:
    gate, axis = make()
    request = replace(
        goal(0.6), setpoints=(Setpoint(1, "position", 0.6), Setpoint(2, "position", 9.0, 0.0, 4.0))
    )
    with pytest.raises(LimitExceeded):
        gate.check(request, NOW)
    assert not axis.moving
    assert not axis.engaged


def test_a_lease_must_hold_and_lets_endless_motion_pass() -> None:
    gate, axis = make()
    now = [NOW]
    gate.lease = Lease(lambda: now[0], 0.5)
    gate.check(goal(0.5, "velocity"), NOW)
    assert axis.endless
    now[0] += 0.6
    for request in (goal(0.6), goal(0.5, "velocity")):
        with pytest.raises(Refused) as caught:
            gate.check(request, NOW)
        assert caught.value.reason == "lease"
    gate.check(goal(0.0, "torque", Stays.STILL, effect=Effect.TORQUE), NOW)
    with pytest.raises(Refused):
        gate.lease.beat()
    gate.lease.reset()
    gate.check(goal(0.6), NOW)


@pytest.mark.parametrize("nodes", [(), (1,), (2,)])
def test_a_stop_takes_the_axis_from_its_source(nodes: tuple[int, ...]) -> None:
    gate, axis = make()
    owner = axis.claim()
    gate.check(goal(0.6), NOW)
    assert axis.moving
    gate.stopped(nodes)
    assert (check_owned([(axis, owner)], None, latched=False) is None) == (nodes == (2,))
    assert axis.moving == (nodes == (2,))


def test_a_deferred_write_begins_once_and_not_after_a_stop() -> None:
    begin: Request[Any] = Request(b"x", effect=Effect.MOTION, deferred=Deferred(None, begins=True))
    for node, ends in ((1, (None, None)), (2, (0.0, 4.0))):
        gate, _ = make()
        write = goal(0.6, node=node, ends=ends, deferred=Deferred(node))
        with pytest.raises(LimitExceeded):
            gate.check(goal(9.0, node=node, ends=ends, deferred=Deferred(node)), NOW)
        gate.check(write, NOW)
        gate.check(begin, NOW)
        with pytest.raises(Refused):
            gate.check(begin, NOW)
        gate.check(write, NOW)
        gate.stopped(())
        gate._bus.stops += 1  # type: ignore[attr-defined]
        with pytest.raises(Refused):
            gate.check(begin, NOW)


def test_a_device_with_a_new_id_keeps_its_limits() -> None:
    gate, _ = make()
    gate._bus.on_id_change(IdChanged(1, 7))  # type: ignore[misc]
    with pytest.raises(LimitExceeded):
        gate.check(goal(1.5, node=7), NOW)


def test_after_a_reconnect_nothing_is_known() -> None:
    gate, axis = make()
    owner = axis.claim()
    gate._bus.on_reconnect()  # type: ignore[misc]
    assert axis.position is None
    assert check_owned([(axis, owner)], None, latched=False) is not None
    with pytest.raises(Refused, match="not known"):
        gate.check(goal(0.6), NOW)


def test_positions_that_no_motor_can_reach_are_suspect_until_a_second_one_agrees() -> None:
    _, axis = make()
    assert axis.take(0.6, NOW + 0.01)
    assert not axis.take(3.0, NOW + 0.02)
    assert axis.position == 0.6
    assert axis.take(3.01, NOW + 0.03)
    assert (axis.position, axis.suspect) == (3.01, None)
    assert not axis.take(-3.0, NOW + 0.04)
    assert axis.take(3.02, NOW + 0.05)


def test_a_stop_in_motion_loses_an_estimate() -> None:
    gate, axis = make()
    axis.position, axis.measured, axis.estimate = None, False, 0.2
    gate.stopped(())
    assert axis.estimate == 0.2
    gate.check(goal(0.1, "relative"), NOW)
    assert axis.estimate is None
    with pytest.raises(NotHomed):
        gate.check(goal(0.1, "relative"), NOW)
