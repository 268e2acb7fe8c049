"""What is said of a machine is what its file and its families say, axis by axis, and nothing is opened for it."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from typing import Any

from motorbus.core.family import Family
from motorbus.core.guarantees import Level
from motorbus.motion.machine import Machine
from motorbus.motion.moving.stream import USUAL
from motorbus.motion.safety.assurance import MACHINE, NONE, SCOPE, WHOLE, assured, unbounded
from motorbus.session import prepare
from tests.support.machines import machine


def families(made: Machine) -> dict[str, Family]:
    return {name: prepare(bus.address, {}).family for name, bus in made.buses.items()}


def test_the_scope_names_the_standards_and_the_switch() -> None:
    assert all(word in SCOPE for word in ("ISO 13849", "IEC 61508", "power cut", "not a safety function"))


def test_each_axis_is_shown_with_the_bounds_of_the_file() -> None:
    axes: dict[str, dict[str, Any]] = {name: {"low": None, "high": None} for name in ("c1", "lift")}
    axes["a1"] = {"max_step": "10 deg", "exit": "torque_off", "estop": "hold"}
    with machine(arm="1-2", can="0x25", lift=True, axes=axes) as (made, _):
        found = {one.name: one for one in assured(made, families(made)).axes}
    first = found["a1"]
    assert (first.device, first.limits, first.step) == ("arm#1", "-150 to 150 deg", "10.0 deg")
    assert (first.velocity, first.exit, first.estop) == ("90 deg/s", "torque_off", "hold")
    assert (found["a2"].step, found["a2"].exit, found["a2"].estop) == (NONE, "hold", "torque_off")
    assert (found["c1"].limits, found["c1"].estop) == ("its device's", "hold")
    assert (found["lift"].limits, found["lift"].left, found["lift"].estop) == (NONE, WHOLE, "stop")


def test_how_far_a_led_axis_goes_on_is_one_cycle_of_the_usual_rate() -> None:
    with machine(arm="1") as (made, _):
        (axis,) = assured(made, families(made)).axes
        spec = made.axes["a1"]
    assert axis.left == spec.show(radians(90) / USUAL) != spec.show(0.0)


def test_each_bus_with_axes_tells_what_its_devices_give() -> None:
    with machine(arm="1-2", lift=True) as (made, _):
        arm, stage = assured(made, families(made)).buses
    assert (arm.name, arm.family, arm.axes) == ("arm", "feetech", ("a1", "a2"))
    assert arm.points["torque switch"].given is Level.YES
    assert stage.points["measures its position"].given is Level.NO
    assert {bus.points["watchdog in it"].given for bus in (arm, stage)} == {Level.NO}


def test_of_a_family_that_says_nothing_nothing_is_claimed() -> None:
    axes = {"a1": {"low": None, "high": None}}
    with machine(arm="1", axes=axes) as (made, _):
        silent = {name: replace(family, safety=None) for name, family in families(made).items()}
        found = assured(made, silent)
    assert found.buses[0].points == {}
    assert (found.axes[0].limits, found.axes[0].left) == (NONE, WHOLE)


def test_what_nobody_bounds_is_told() -> None:
    axes: dict[str, dict[str, Any]] = {"a1": {"max_step": "10 deg"}, "lift": {"low": None, "high": None}}
    axes["a2"] = {"guard": False}
    with machine(arm="1-2", lift=True, axes=axes) as (made, _):
        limits, step, guard = unbounded(assured(made, families(made)))
    assert limits.startswith("lift: no limits of travel")
    assert step.startswith("a2, lift: one order may lead from one end to the other")
    assert guard == "a2, lift: neither load nor heat ends a movement"


def test_the_machine_as_a_whole_promises_nothing_of_what_nobody_can() -> None:
    given = {about: point.given for about, point in MACHINE.items()}
    assert {about for about, one in given.items() if one is Level.NO} == {
        "the host dies",
        "a cable breaks",
        "several hosts",
    }
    assert given["one gate"] is Level.YES
    assert given["velocity"] is given["acceleration"] is Level.PARTLY


def test_a_guard_is_on_where_a_device_tells_its_strain_and_nobody_switched_it_off() -> None:
    with machine(arm="1-2", lift=True, axes={"a2": {"guard": False}}) as (made, _):
        found = {one.name: one.guard for one in assured(made, families(made)).axes}
    assert found == {"a1": "on", "a2": "none", "lift": "none"}
