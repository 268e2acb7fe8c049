"""Parts that must agree are judged however a machine was made, and what agrees passes."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.motion.machine import BusSpec, GroupSpec, Machine
from motorbus.motion.machine.agreement import check
from tests.motion.machine.files import axis

BUSES = {"arm": BusSpec(address="feetech:/dev/ttyACM0")}


def machine(**parts: Any) -> Machine:
    """A machine with one bus, and these parts."""
    return Machine(**{"buses": BUSES, **parts})


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"axes": {"arm": axis()}}, "axis.arm: this is the name of bus.arm too"),
        (
            {"axes": {"a": axis()}, "groups": {"a": GroupSpec(axes=("a",))}},
            "group.a: this is the name of axis.a",
        ),
        ({"axes": {"a": axis(device="leg#1")}}, "axis.a.device: there is no bus leg"),
        ({"axes": {"a": axis(device="arm#2147483648")}}, "axis.a.device: 2147483648 is no id"),
        ({"axes": {"a": axis(), "b": axis(device="arm#01")}}, "axis.b.device: arm#01 moves axis.a already"),
        ({"axes": {"a": axis(unit="mm")}}, "axis.a.unit: mm is not possible"),
        ({"axes": {"a": axis(travel=1.0)}}, "axis.a.unit: deg is not possible"),
        ({"axes": {"a": axis(low=1.0)}}, "axis.a.high: is missing, and low is there"),
        ({"axes": {"a": axis(high=1.0)}}, "axis.a.low: is missing, and high is there"),
        ({"axes": {"a": axis(low=1.0, high=1.0)}}, "axis.a.high: it is 57.3 deg like low"),
        ({"axes": {"a": axis(low=1.0, high=-1.0)}}, "axis.a.low: 57.3 deg is above high, which is -57.3 deg"),
        ({"axes": {"a": axis(exit="park")}}, "axis.a.park: is missing"),
        ({"axes": {"a": axis(low=0.0, high=1.0, park=2.0)}}, "axis.a.park: 114.6 deg is outside the limits"),
        ({"axes": {"a": axis(torque=0.5, current=1.0)}}, "axis.a.current: torque is there too"),
        ({"groups": {"g": GroupSpec(axes=("a",))}}, "group.g.axes[0]: there is no axis 'a'"),
        (
            {"axes": {"a": axis()}, "groups": {"g": GroupSpec(axes=("a", "a"))}},
            "group.g.axes[1]: a is named twice",
        ),
        (
            {"axes": {"a": axis(low=0.0, high=1.0)}, "poses": {"p": {"a": 2.0}}},
            "pose.p.a: 114.6 deg is outside the limits",
        ),
        (
            {"axes": {"a": axis()}, "poses": {"p": {"a": float("nan")}}},
            "pose.p.a: nan deg is outside the limits",
        ),
        ({"poses": {"p": {"b": 0.0}}}, "pose.p.b: there is no axis 'b'"),
    ],
)
def test_what_does_not_agree_is_told_where_it_stands(parts: dict[str, Any], says: str) -> None:
    with pytest.raises(RequestError) as caught:
        check(machine(**parts))
    assert caught.value.summary.startswith(says)
    assert caught.value.expected


def test_the_same_id_on_two_buses_is_two_devices() -> None:
    buses = {**BUSES, "leg": BusSpec(address="feetech:/dev/ttyACM1")}
    check(machine(buses=buses, axes={"a": axis(), "b": axis(device="leg#1")}))


def test_parking_without_limits_may_be_anywhere() -> None:
    check(machine(axes={"a": axis(exit="park", park=100.0)}))
