"""The family as the rest of motorbus knows it, and the names that users import."""

from __future__ import annotations

import motorbus
from motorbus import families
from motorbus.families.stepper import FAMILY, Stepper


def test_it_is_found_by_its_name() -> None:
    assert "stepper" in families.names()
    assert families.load("stepper") is FAMILY


def test_what_a_user_needs_is_there() -> None:
    program = motorbus.stepper.Program.load("examples/pick_and_place.toml")
    assert str(program.estimate()).startswith("at least ")
    assert {name for name in motorbus.stepper.__all__ if not hasattr(motorbus.stepper, name)} == set()


def test_a_bus_without_settings_speaks_as_the_manual_says() -> None:
    assert FAMILY.configured() is FAMILY
    other = FAMILY.configured(motor="5")
    assert isinstance(other, Stepper)
    assert other.stop({1: None}).exchanges[1].request[2] == 5
    assert FAMILY.stop({1: None}).exchanges[1].request[2] == 3


def test_nothing_of_it_moves_an_axis_yet() -> None:
    assert FAMILY.axis("stepper controller") == {}


def test_a_simulation_has_the_motor_of_its_bus() -> None:
    simulator = FAMILY.configured(motor=7).simulator((1,))
    simulator.receive(bytes.fromhex("FFAA070D000000000000BD"), 0.0)
    assert [data for _, data in simulator.advance(1.0)] == [bytes.fromhex("FFAA070D0000")]
