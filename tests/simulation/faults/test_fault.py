"""A fault is a value that knows what is impossible, prints itself, and can be settled at a place."""

from __future__ import annotations

from math import inf
from random import Random
from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.link.base import Side
from motorbus.simulation.faults import ANY, Fault
from motorbus.simulation.faults.fault import number


@pytest.mark.parametrize(
    "wrong",
    [
        {"action": "explode"},
        {"exchange": None},
        {"percent": 1.0},
        {"moment": 1.0},
        {"exchange": -1},
        {"byte": -1},
        {"packet": 0},
        {"byte": 1, "packet": 2},
        {"exchange": None, "percent": 1.0, "byte": 3},
        {"exchange": None, "percent": inf},
        {"exchange": None, "percent": 100.5},
        {"exchange": None, "percent": -1.0},
        {"exchange": None, "moment": -1.0},
        {"exchange": None, "moment": 1e9},
        {"action": "unplug", "seconds": 1e308},
        {"action": "delay", "seconds": 0.1, "until": 4e7},
        {"action": "merge", "byte": 1},
        {"action": "echo", "to": Side.HOST},
        {"action": "corrupt", "value": 0},
        {"action": "corrupt", "value": 256},
        {"action": "corrupt", "value": ANY, "byte": 1},
        {"action": "flip", "value": 8},
        {"action": "delay"},
        {"action": "delay", "seconds": inf},
        {"action": "delay", "seconds": 0.2, "until": 0.1},
        {"action": "stall", "seconds": 0.2, "until": 0.3},
        {"action": "split", "seconds": -1.0},
        {"action": "torn-eeprom"},
        {"action": "delay", "seconds": 1.0, "adapter": True},
        {"action": "reorder", "seconds": 1.0, "adapter": True},
        {"action": "reorder", "seconds": 1.0, "byte": 2},
        {"action": "reorder", "seconds": 1.0, "exchange": None, "percent": 1.0, "per_byte": True},
    ],
)
def test_what_is_impossible_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(RequestError):
        Fault(**{"exchange": 1, "action": "drop", **wrong})


def test_the_usual_side_is_that_of_the_word() -> None:
    assert Fault(1, 2, "drop").to is Side.HOST
    assert Fault(1, None, "echo").to is Side.DEVICE
    assert Fault(1, None, "unplug", seconds=1.0).to is Side.DEVICE
    assert str(Fault(1, 2, "drop", Side.DEVICE)) == "exchange 1 byte 2 to device: drop"
    assert str(Fault(1, 2, "unplug", Side.HOST, seconds=1.0)) == "exchange 1 byte 2 to host: unplug 1"


def test_settled_it_is_a_place_and_leaves_nothing_open() -> None:
    loose = Fault(action="delay", percent=3.0, seconds=0.1, until=0.5)
    settled = loose.settled(7, 2, None, Random(1))
    assert (settled.exchange, settled.packet, settled.percent, settled.until) == (7, 2, 0.0, 0.0)
    assert 0.1 <= settled.seconds <= 0.5
    assert not settled.by_chance
    settled = Fault(action="corrupt", percent=3.0, per_byte=True, value=ANY).settled(7, 2, 9, Random(1))
    assert (settled.exchange, settled.packet, settled.byte) == (7, 1, 9)
    assert 1 <= settled.value <= 255
    assert not settled.by_chance


@pytest.mark.parametrize("value", [1.0, 0.1, 1e-9, 1 / 3, 123456789.123, 0.02])
def test_a_number_is_short_and_the_same(value: float) -> None:
    assert float(number(value)) == value
    assert number(0.02) == "0.02"
    assert number(3600.0) == "3600"
