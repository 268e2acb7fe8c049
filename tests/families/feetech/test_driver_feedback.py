"""Telemetry in one READ, each quantity as a verb, and what an unknown servo can tell."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.core.operation import Exchange
from motorbus.errors import DeviceError, VerificationFailed
from motorbus.families.feetech.driver import (
    Node,
    current,
    load,
    position,
    telemetry,
    temperature,
    velocity,
    voltage,
)
from tests.families.feetech.driver_script import play, prepared, prepares, reads

COUNT = tau / 4096
FEEDBACK = (0x18, 0x05, 0xE8, 0x83, 0x64, 0x04, 121, 42, 0, 0x20, 1, 0, 8, 0x0A, 0x80)


def test_everything_in_one_read() -> None:
    node = prepared()
    state = play(telemetry(node), reads(3, 56, *FEEDBACK, error=0x20))
    assert state.position == pytest.approx(1304 * COUNT)
    assert state.velocity == pytest.approx(-1000 * COUNT)
    assert [state.load, state.voltage, state.temperature] == pytest.approx([-0.1, 12.1, 42])
    assert state.current == pytest.approx(-0.065)
    assert (state.moving, state.alarm, state.at) == (True, ("overload",), node.at)


def test_telemetry_of_a_known_servo_is_one_exchange_to_be_kept() -> None:
    exchange = telemetry(prepared())
    assert isinstance(exchange, Exchange)
    assert exchange.tells_position
    for _ in range(2):
        play(exchange, reads(3, 56, *FEEDBACK))


def test_telemetry_of_a_new_servo_asks_it_first() -> None:
    state = play(telemetry(Node(3)), prepares(at_18=0b1000), reads(3, 56, *FEEDBACK))
    assert state.velocity == pytest.approx(-50_000 * COUNT)


def test_a_bridge_without_current_feedback_tells_no_current() -> None:
    assert play(telemetry(prepared(at_18=0b10_1100)), reads(3, 56, *FEEDBACK)).current is None


def test_an_unknown_servo_tells_what_means_the_same_in_all_maps() -> None:
    state = play(telemetry(Node(3)), prepares(at_0=9), reads(3, 56, *FEEDBACK))
    assert (state.position, state.velocity, state.current) == (None, None, None)
    assert [state.load, state.voltage, state.temperature] == pytest.approx([-0.1, 12.1, 42])
    assert state.moving is True


@pytest.mark.parametrize(
    ("verb", "address", "data", "value"),
    [
        (position, 56, (0x18, 0x05), 1304 * COUNT),
        (position, 56, (0x05, 0x80), -5 * COUNT),
        (position, 56, (0x00, 0x80), 0.0),
        (velocity, 58, (0xE8, 0x83), -1000 * COUNT),
        (load, 60, (0x64, 0x04), -0.1),
        (voltage, 62, (74,), 7.4),
        (temperature, 63, (30,), 30.0),
        (current, 69, (0x0A, 0x00), 0.065),
    ],
)
def test_each_quantity_is_one_read_of_a_known_servo(
    verb: object, address: int, data: tuple[int, ...], value: float
) -> None:
    assert callable(verb)
    exchange = verb(prepared())
    assert isinstance(exchange, Exchange)
    assert play(exchange, reads(3, address, *data)) == pytest.approx(value)


def test_a_quantity_of_a_new_servo_asks_it_first() -> None:
    node = Node(3)
    assert play(position(node), prepares(), reads(3, 56, 0x18, 0x05)) == pytest.approx(1304 * COUNT)
    assert play(position(node), reads(3, 56, 0, 0)) == 0


@pytest.mark.parametrize("verb", [position, velocity, current])
def test_what_an_unknown_servo_cannot_tell_in_a_unit_is_refused(verb: object) -> None:
    assert callable(verb)
    with pytest.raises(DeviceError, match="cannot tell its present"):
        play(verb(Node(3)), prepares(at_0=9))


def test_an_unknown_servo_tells_its_voltage() -> None:
    assert play(voltage(Node(3)), prepares(at_0=9), reads(3, 62, 74)) == pytest.approx(7.4)


def test_a_confirmed_position_is_one_that_two_readings_in_a_row_tell() -> None:
    told = play(
        position(prepared(), confirmed=True),
        reads(3, 56, 0x18, 0x05),
        reads(3, 56, 0x18, 0x06),
        reads(3, 56, 0x18, 0x06),
    )
    assert told == pytest.approx(0x618 * COUNT)


def test_a_position_that_changes_all_the_time_is_not_confirmed() -> None:
    with pytest.raises(VerificationFailed, match="position"):
        play(position(prepared(), confirmed=True), *[reads(3, 56, low, 0x05) for low in range(8)])
