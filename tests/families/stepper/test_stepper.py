"""The family as the rest of motorbus knows it, and the names that users import."""

from __future__ import annotations

import pytest

import motorbus
from motorbus import families
from motorbus.core.family import Identity
from motorbus.errors import RequestError
from motorbus.families.stepper import FAMILY, Controller, StepperDriver


def test_it_is_found_by_its_name() -> None:
    assert "stepper" in families.names()
    assert families.load("stepper") is FAMILY


def test_what_a_user_needs_is_there() -> None:
    program = motorbus.stepper.Program.load("examples/pick_and_place.toml")
    assert str(program.estimate()).startswith("at least ")
    assert {name for name in motorbus.stepper.__all__ if not hasattr(motorbus.stepper, name)} == set()


def test_a_bus_without_settings_speaks_as_the_manual_says() -> None:
    assert FAMILY.open().stop({1: None}).requests[1].wire[2] == 3
    other = FAMILY.open(motor="5")
    assert isinstance(other, StepperDriver)
    assert other.stop({1: None}).requests[1].wire[2] == 5
    assert FAMILY.open().stop({1: None}).requests[1].wire[2] == 3


def test_each_bus_has_a_memory_of_its_own() -> None:
    with motorbus.open("stepper:sim") as bus, motorbus.open("stepper:sim") as other:
        Controller(bus).memory.owed = True
        assert Controller(bus).memory.owed
        assert not Controller(other).memory.owed


def test_it_is_an_axis_that_moves_by_and_has_no_position() -> None:
    axis = FAMILY.open().axis(Identity(0, "stepper controller", "", ""))
    assert axis.names == {"move_by", "jog", "home", "keep_time", "run", "stop"}
    assert not FAMILY.open().axis(Identity(0, "", "", "")).names


def test_a_simulation_has_the_motor_of_its_bus() -> None:
    simulator = FAMILY.simulator((1,), motor=7)
    simulator.receive(bytes.fromhex("FFAA070D000000000000BD"), 0.0)
    assert [data for _, data in simulator.advance(1.0)] == [bytes.fromhex("FFAA070D0000")]


def test_a_bus_is_told_how_its_dumps_are_to_be_read() -> None:
    with motorbus.simulate("stepper", dump_order="big") as simulation:
        assert simulation.url.endswith(",dump_order=big")
        with motorbus.open(simulation.url) as bus:
            device = motorbus.stepper.Controller(bus)
            assert (device.motor, device.order) == (3, "big")
            assert device.read_raw("microsteps", "step_1_delay") == {"microsteps": 8, "step_1_delay": 1000}
            assert device.read("step_1_delay") == {"step_1_delay": 1.0}
            assert device.read_project(1).project.microsteps == 8
            dump = device.dump(1)
    assert FAMILY.open(dump_order="big").decode(dump)[0].fault == ""
    named = {part.name: part.meaning for part in FAMILY.open(dump_order="big").decode(dump)[0].parts}
    assert (named["microsteps"], named["step_1_delay"]) == ("8", "1000 ms")


def test_settings_are_kept_apart_and_checked() -> None:
    both = FAMILY.open(motor=7, dump_order="big")
    assert both.stop({1: None}).requests[1].wire[2] == 7
    with pytest.raises(RequestError, match="dump_order='middle'") as caught:
        FAMILY.open(dump_order="middle")
    assert caught.value.expected == "little or big"
    with pytest.raises(RequestError, match="no setting 'order'"):
        FAMILY.open(order="big")
