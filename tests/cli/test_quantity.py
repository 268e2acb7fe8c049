"""Values of registers, as typed and as shown."""

from __future__ import annotations

import math

import pytest

from motorbus.cli import quantity
from motorbus.core.register import Access, Register, Storage
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.node import Node, Settings
from motorbus.families.feetech.table import STS

ANGLE = Register(
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
MODE = Register(
    name="mode",
    address=3,
    size=1,
    access=Access.READ_WRITE,
    storage=Storage.EEPROM,
    source="this test",
    high=3,
    choices={0: "position", 1: "velocity"},
)
FLAGS = Register(
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
    ("text", "number"),
    [("1.5", 1.5), ("90deg", math.pi / 2), ("-45°", -math.pi / 4), ("0.25 turn", math.pi / 2)],
)
def test_an_angle_is_typed_with_or_without_unit(text: str, number: float) -> None:
    typed = quantity.typed(ANGLE, text)
    assert typed.number == pytest.approx(number)
    assert not typed.raw


@pytest.mark.parametrize(
    ("text", "raw"),
    [("2048raw", False), (" 0x800 raw", False), ("2048", True), ("0x800", True), ("2048raw", True)],
)
def test_a_raw_value_is_said_to_be_one(text: str, raw: bool) -> None:
    assert quantity.typed(ANGLE, text, raw=raw) == (2048, True, False)


@pytest.mark.parametrize(("text", "number"), [("velocity", 1), ("Position", 0), ("3", 3), ("0x02", 2)])
def test_a_plain_number_may_be_named(text: str, number: int) -> None:
    assert quantity.typed(MODE, text) == (number, True, text.isalpha())


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        (ANGLE, "nan"),
        (ANGLE, "inf"),
        (ANGLE, "far"),
        (ANGLE, ""),
        (ANGLE, "1A"),
        (ANGLE, "raw"),
        (ANGLE, "2.5raw"),
        (MODE, "sideways"),
        (MODE, "1.5"),
    ],
)
def test_what_is_no_value_is_refused(entry: Register, text: str) -> None:
    with pytest.raises(RequestError):
        quantity.typed(entry, text)


def test_a_raw_value_has_no_unit() -> None:
    with pytest.raises(RequestError):
        quantity.typed(ANGLE, "90deg", raw=True)


def test_a_row_converts_where_a_device_cannot() -> None:
    assert quantity.to_value(object(), ANGLE, 2048) == pytest.approx(math.pi)
    assert quantity.to_raw(object(), ANGLE, math.pi) == 2048


def test_a_device_that_converts_by_its_settings_is_asked() -> None:
    servo = Node(1)
    servo.settings = Settings(factors={"present_velocity": 50.0})
    row = STS["present_velocity"]
    assert quantity.to_value(servo, row, 2) == pytest.approx(100 * row.scale)
    assert quantity.to_raw(servo, row, 100 * row.scale) == 2


def test_the_choices_are_offered_when_a_name_is_wrong() -> None:
    with pytest.raises(RequestError, match="position, velocity"):
        quantity.typed(MODE, "sideways")


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
def test_a_raw_value_is_told_in_words(entry: Register, raw: int, text: str) -> None:
    assert quantity.meaning(entry, raw) == text
