"""Values of registers, as typed and as shown."""

from __future__ import annotations

import math

import pytest

from motorbus.cli import quantity
from motorbus.core.entry import Access, Entry, Storage
from motorbus.errors import RequestError

ANGLE = Entry(
    name="angle",
    address=1,
    size=2,
    access=Access.READ_WRITE,
    storage=Storage.RAM,
    source="this test",
    unit="rad",
    scale=math.tau / 4096,
    high=4095,
)
MODE = Entry(
    name="mode",
    address=3,
    size=1,
    access=Access.READ_WRITE,
    storage=Storage.EEPROM,
    source="this test",
    high=3,
    choices={0: "position", 1: "velocity"},
)
FLAGS = Entry(
    name="flags",
    address=4,
    size=1,
    access=Access.READ,
    storage=Storage.RAM,
    source="this test",
    high=255,
    bits={0: "hot", 3: "stuck"},
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.5", 1.5),
        ("90deg", math.pi / 2),
        ("-45°", -math.pi / 4),
        ("2048raw", math.pi),
        ("0.25 turn", math.pi / 2),
    ],
)
def test_an_angle_is_typed_with_or_without_unit(text: str, value: float) -> None:
    assert quantity.value(ANGLE, text) == pytest.approx(value)


@pytest.mark.parametrize(("text", "value"), [("velocity", 1), ("Position", 0), ("3", 3), ("0x02", 2)])
def test_a_plain_number_may_be_named(text: str, value: int) -> None:
    assert quantity.value(MODE, text) == value


@pytest.mark.parametrize(
    ("entry", "text"),
    [(ANGLE, "nan"), (ANGLE, "inf"), (ANGLE, "far"), (ANGLE, ""), (ANGLE, "1A"), (MODE, "sideways")],
)
def test_what_is_no_value_is_refused(entry: Entry, text: str) -> None:
    with pytest.raises(RequestError):
        quantity.value(entry, text)


def test_the_choices_are_offered_when_a_name_is_wrong() -> None:
    with pytest.raises(RequestError, match="position, velocity"):
        quantity.value(MODE, "sideways")


@pytest.mark.parametrize(
    ("number", "unit", "text"),
    [(None, "rad", ""), (math.pi, "rad", "3.1416 rad (180.0°)"), (0.5, "fraction", "50.0 %"), (7, "", "7")],
)
def test_a_value_is_shown_with_its_unit(number: float | None, unit: str, text: str) -> None:
    assert quantity.shown(number, unit) == text


@pytest.mark.parametrize(
    ("entry", "raw", "text"),
    [(MODE, 1, "velocity"), (MODE, 3, ""), (FLAGS, 9, "hot, stuck"), (FLAGS, 0, "")],
)
def test_a_raw_value_is_told_in_words(entry: Entry, raw: int, text: str) -> None:
    assert quantity.meaning(entry, raw) == text
