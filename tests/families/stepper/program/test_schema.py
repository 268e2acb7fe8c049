"""The schema: it is one, it knows every field, and its patterns take what reading takes."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.program import quantities, schema, text
from motorbus.families.stepper.program.quantities import Geometry
from motorbus.families.stepper.table import Project

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
    ],
)
def test_a_pattern_takes_what_reading_takes(field: str, said: str) -> None:
    readers = {"move": quantities.distance, "speed": quantities.speed}
    try:
        if field == "start":
            quantities.hertz(said, "x")
        else:
            readers[field](said, "x", PLAIN)
        taken = True
    except RequestError:
        taken = False
    assert bool(re.search(STEP[field]["pattern"], said)) is taken or said == "90°"


def test_what_is_needed_is_said() -> None:
    assert MADE["required"] == ["format", "motor", "step"]
    assert MADE["properties"]["motor"]["required"] == ["microsteps"]
    assert MADE["properties"]["loop"]["required"] == ["first", "last", "count"]
