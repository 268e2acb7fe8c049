"""The schema: it is one, it knows every field, and its patterns take what reading takes."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.program import names, quantities, schema, text
from motorbus.families.stepper.program.quantities import Geometry
from motorbus.families.stepper.table import Project

EXAMPLE = Path(__file__).resolve().parents[4] / "examples" / "pick_and_place.toml"
MADE = schema()
STEP: dict[str, Any] = MADE["properties"]["step"]["items"]["properties"]
MOTOR: dict[str, Any] = MADE["properties"]["motor"]["properties"]
PLAIN = Geometry.of(Project(microsteps=8, step_angle=180, turn_distance=36000), Fraction(5))


def test_it_is_json_and_always_the_same() -> None:
    assert json.loads(json.dumps(MADE)) == MADE == schema()
    assert MADE["$schema"].endswith("2020-12/schema")


def test_it_knows_exactly_the_fields_that_are_read() -> None:
    assert tuple(MADE["properties"]) == text.TOP
    assert set(MOTOR) == set(text.MOTOR)
    assert set(MADE["properties"]["loop"]["properties"]) == set(text.LOOP)
    assert tuple(STEP) == text.STEP


def test_ranges_are_those_of_the_rows() -> None:
    assert (MOTOR["microsteps"]["minimum"], MOTOR["microsteps"]["maximum"]) == (1, 65535)
    assert (MOTOR["turn_distance"]["minimum"], MOTOR["turn_distance"]["maximum"]) == (1, 16777215)
    assert MADE["properties"]["project"]["maximum"] == 4
    assert MADE["properties"]["step"]["maxItems"] == 10
    assert MADE["properties"]["outputs"]["additionalProperties"]["maximum"] == 3


@pytest.mark.parametrize(
    ("field", "said"),
    [
        ("move", "10 mm"),
        ("move", "-0.5 turns"),
        ("move", "1 turn"),
        ("move", "90°"),
        ("move", "7 units"),
        ("move", "10"),
        ("move", "10 inch"),
        ("move", "x mm"),
        ("speed", "60 rpm"),
        ("speed", "-60 rpm"),
        ("speed", "60 mph"),
        ("start", "1.5 kHz"),
        ("start", "50"),
        ("move", "90 degrees"),
        ("move", "1e9 mm"),
        ("move", "9" * 21 + " units"),
        ("speed", "60 RPM"),
        ("speed", "1e999 rpm"),
        ("delay", "2 min 30 s"),
        ("delay", "500ms"),
        ("delay", "500"),
        ("delay", "soon"),
        ("delay", "-5 s"),
        ("output", "none"),
        ("output", "all off"),
        ("output", "output 3 on"),
        ("output", "output 4 on"),
        ("output", "valve on"),
        ("output", "valve"),
        ("output", "valve up"),
        ("wait_for", "none"),
        ("wait_for", "button"),
        ("wait_for", "input 5"),
        ("wait_for", "1button"),
        ("wait_for", ""),
        ("stop_on", "button"),
    ],
)
def test_a_pattern_takes_what_reading_takes(field: str, said: str) -> None:
    """For one who uses the names of the file; whether a name is one of them, and its number, only reading tells."""
    inputs, outputs = {"button": 1}, {"valve": 3}
    readers: dict[str, Callable[[], object]] = {
        "move": lambda: quantities.distance(said, "x", PLAIN),
        "speed": lambda: quantities.speed(said, "x", PLAIN),
        "start": lambda: quantities.hertz(said, "x"),
        "delay": lambda: quantities.milliseconds(said, "x"),
        "output": lambda: names.output_of(said, "x", outputs),
        "wait_for": lambda: names.input_of(said, "x", inputs),
        "stop_on": lambda: names.input_of(said, "x", inputs),
    }
    try:
        readers[field]()
        taken = True
    except RequestError:
        taken = False
    row = STEP[field]
    pattern = row["pattern"] if "pattern" in row else row["anyOf"][1]["pattern"]
    assert bool(re.search(pattern, said)) is taken


@pytest.mark.parametrize(
    ("unit", "taken"),
    [
        ("pulse", True),
        ("0.001 mm", True),
        ("2 pulses", True),
        ("turn", True),
        ("0.01°", True),
        ("5 units", False),
        ("x", False),
    ],
)
def test_the_unit_of_distances_is_checked_too(unit: str, taken: bool) -> None:
    assert bool(re.search(MOTOR["unit"]["pattern"], unit)) is taken


def test_names_are_checked_too() -> None:
    pattern = MADE["properties"]["inputs"]["propertyNames"]["pattern"]
    assert re.search(pattern, "go on")
    assert not re.search(pattern, "1st")
    assert MADE["properties"]["outputs"]["maxProperties"] == 3
    (number, _) = STEP["wait_for"]["anyOf"]
    assert (number["minimum"], number["maximum"]) == (0, 5)


def test_the_example_fits_it() -> None:
    """Every text of the example fits the pattern of its field."""
    example = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    for step in example["step"]:
        for key, value in step.items():
            patterns = (
                [STEP[key]["pattern"]] if "pattern" in STEP[key] else [STEP[key]["anyOf"][1]["pattern"]]
            )
            assert re.search(patterns[0], value), (key, value)


def test_what_is_needed_is_said() -> None:
    assert MADE["required"] == ["format", "motor", "step"]
    assert MADE["properties"]["motor"]["required"] == ["microsteps"]
    assert MADE["properties"]["loop"]["required"] == ["first", "last", "count"]
