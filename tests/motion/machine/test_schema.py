"""The schema: it is one, it takes what reading takes, and refuses of the broken files what a schema can see."""

from __future__ import annotations

import json
import tomllib
from typing import Any

import pytest
from hypothesis import given
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]

from motorbus.motion.machine import Machine, keys, schema
from tests.motion.machine.files import BROKEN, DEEP, GOOD, Broken, machines

MADE = schema()
SCHEMA = Draft202012Validator(MADE)
# What cannot be read as data has none for a schema, and what is too deep for Python to print is too deep for it.
DATA = [one for one in BROKEN if not one.says.startswith("the file is no TOML") and one.new != DEEP]
AXES = [MADE["$defs"][f"{kind}_axis"] for kind in ("turning", "linear")]


def refuses(data: Any) -> list[str]:
    """Why the schema refuses it; nothing where it does not."""
    return [error.message for error in SCHEMA.iter_errors(data)]


def test_it_is_a_schema_and_always_the_same() -> None:
    Draft202012Validator.check_schema(MADE)
    assert json.loads(json.dumps(MADE)) == MADE == schema()


def test_it_knows_exactly_the_keys_that_are_read() -> None:
    turning, linear = (list(axis["properties"]) for axis in AXES)
    assert list(MADE["properties"]) == list(keys.TOP)
    assert linear == list(keys.AXIS)
    assert turning == [name for name in keys.AXIS if name != "travel"]


def test_every_key_is_described() -> None:
    tables = [MADE, *MADE["$defs"].values()]
    described = [row for table in tables for row in table.get("properties", {}).values()]
    assert [row for row in described if not row.get("description")] == []


def test_it_takes_the_example() -> None:
    assert refuses(tomllib.loads(GOOD)) == []


@pytest.mark.parametrize("broken", [pytest.param(one, id=one.says[:50]) for one in DATA])
def test_it_refuses_what_a_schema_can_see(broken: Broken) -> None:
    assert bool(refuses(tomllib.loads(broken.text))) is broken.schema


def test_it_sees_most_of_the_broken_ones() -> None:
    assert sum(one.schema for one in BROKEN) >= 45


@given(machines())
def test_it_takes_whatever_is_written(machine: Machine) -> None:
    assert refuses(tomllib.loads(machine.text())) == []


@pytest.mark.parametrize(
    ("said", "taken"),
    [
        ('low = "-90 deg"', True), ('low = "-90deg"', True), ('low = " 1e3 rad "', True), ('low = ".5"', False),
        ('low = "90°"', True), ('low = "deg"', False), ('low = "90 mm"', False), ('low = "--90 deg"', False),
        ('low = "1,5 deg"', False), ("low = true", False), ("low = 2", False), ('low = "٣ deg"', False),
        ('max_velocity = "-5 deg/s"', False), ('max_velocity = "+5 deg/s"', True), ("max_velocity = 90", False),
        ('max_acceleration = "5 rad/s^2"', True), ('max_acceleration = "5 rad/s"', False),
        ('torque = "50 %"', True), ("torque = 1.5", False), ("sign = 2", False), ("gear = 1e-9", False),
    ],
)  # fmt: skip
def test_a_value_of_an_axis_that_turns(said: str, taken: bool) -> None:
    text = f'format = 1\n[axis.a]\ndevice = "x#1"\nhigh = "3 rad"\n{said}'
    text += "\nlow = '1 rad'" if "low" not in said else ""
    assert (refuses(tomllib.loads(text)) == []) is taken


def test_defaults_are_those_of_reading() -> None:
    turning, linear = (
        {name: row["default"] for name, row in axis["properties"].items() if "default" in row}
        for axis in AXES
    )
    assert turning == {
        "zero": "0 deg", "sign": 1, "gear": 1.0, "unit": "deg", "max_velocity": "90 deg/s",
        "max_acceleration": "360 deg/s2", "exit": "hold", "guard": True,
    }  # fmt: skip
    assert linear == turning | {"unit": "mm", "max_velocity": "50 mm/s", "max_acceleration": "200 mm/s2"}
