"""Rows of keys: each has all that reading, the schema and the page ask for, and its example can be read."""

from __future__ import annotations

import tomllib

import pytest

from motorbus.core import units
from motorbus.motion.machine import AxisSpec, keys
from motorbus.motion.machine.keys import AXIS, Key, api_unit, word
from motorbus.motion.machine.model import LOAD, POSITION
from motorbus.motion.machine.reading import read

KINDS = pytest.mark.parametrize("linear", [False, True], ids=["turning", "linear"])


def test_every_field_has_its_row() -> None:
    assert list(AXIS) == list(AxisSpec.__struct_fields__)
    assert list(keys.TOP) == ["format", "name", "bus", "axis", "group", "pose"]
    assert [
        key.name for key in (*AXIS.values(), *keys.BUS.values(), *keys.GROUP.values()) if not key.says
    ] == []


def test_what_is_needed_is_little() -> None:
    tables = (keys.FILE, keys.BUS, AXIS, keys.GROUP)
    assert [key.name for table in tables for key in table.values() if key.needed] == [
        "address",
        "device",
        "axes",
    ]


@KINDS
@pytest.mark.parametrize("key", AXIS.values(), ids=lambda key: str(key.name))
def test_an_example_can_be_read(key: Key, linear: bool) -> None:
    others = {"low": "high = 1e3", "high": "low = -1e3", "park": "exit = 'park'"}
    lines = {
        "device": 'device = "arm#2"',
        "travel": "travel = 1" if linear else "",
        key.name: f"{key.name} = {key.example[linear]}\n{others.get(key.name, '')}",
    }
    text = "\n".join(['format = 1\n[bus.arm]\naddress = "x:y"\n[axis.a]', *lines.values()])
    said = tomllib.loads(f"it = {key.example[linear]}")["it"]
    value = units.parse(said, key.measure.of(linear)) if key.measure and isinstance(said, str) else said
    assert getattr(read(text).axes["a"], key.name) == value


@KINDS
def test_what_is_usual_is_a_value_of_that_quantity(linear: bool) -> None:
    for key in AXIS.values():
        if key.measure and key.usual[linear]:
            assert units.parse(key.usual[linear], key.measure.of(linear)) > 0


def test_choices_and_ranges_in_words() -> None:
    assert AXIS["unit"].choices(True) == ("mm", "m")
    assert AXIS["unit"].choices(False) == ("deg", "rad", "turn")
    assert AXIS["exit"].choices(False) == ("hold", "torque_off", "park", "leave")
    assert AXIS["guard"].choices(False) == (True, False)
    assert [word(one) for one in (True, "hold", -1)] == ["true", "hold", "-1"]
    assert AXIS["gear"].choices(False) == ()
    assert AXIS["torque"].range(False) == "above 0, at most 1"
    assert AXIS["low"].range(True) == "-1000000 to 1000000 m"
    assert AXIS["device"].range(False) == ""


def test_units_are_those_of_the_quantity() -> None:
    assert AXIS["low"].units(True) == tuple(units.SCALES["length"])
    assert AXIS["zero"].units(True) == tuple(units.SCALES["position"])
    assert AXIS["sign"].units(False) == ()
    assert (api_unit(POSITION.turning), api_unit(POSITION.linear), api_unit(LOAD.turning)) == ("rad", "m", "")
