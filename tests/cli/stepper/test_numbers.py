"""Numbers of the manual as people type them."""

from __future__ import annotations

import pytest

from motorbus.cli.stepper.numbers import expected, number
from motorbus.errors import RequestError


@pytest.mark.parametrize(
    ("name", "text", "raw"),
    [
        ("delay", "1000", 1000),
        ("delay", "1s", 1000),
        ("delay", "0x10", 16),
        ("delay", "2 min", 120_000),
        ("speed", "100", 100),
        ("speed", "100rpm", 100),
        ("speed", "10.471975511965978 rad/s", 100),
        ("step_angle", "1.8deg", 180),
        ("step_angle", "0.9°", 90),
        ("output", "all off", 8),
        ("output", "Output 2 on", 2),
        ("direction", "reverse", 1),
        ("start_input", "none", 0),
        ("start_input", "input 5", 5),
        ("project_loop", "endless", 255),
        ("power_on_home", "on", 1),
        ("level", "off", 0),
        ("distance", "-3", -3),
    ],
)
def test_a_number_a_quantity_or_a_name(name: str, text: str, raw: int) -> None:
    assert number(name, text) == raw


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("delay", "0.5ms", "0 or 1"),
        ("speed", "99.5rpm", "99 or 100"),
        ("step_angle", "1.805deg", "180 or 181"),
        ("delay", "1e999s", "too large"),
        ("distance", "5mm", "whole number"),
        ("output", "gripper", "all on"),
        ("delay", "", "is empty"),
    ],
)
def test_what_is_none_is_refused_and_nothing_is_rounded(name: str, text: str, told: str) -> None:
    with pytest.raises(RequestError) as caught:
        number(name, text)
    assert told in str(caught.value)


def test_what_may_be_typed_is_said_once() -> None:
    assert expected("direction") == "0 to 1; 0 is forward; 1 is reverse"
    assert "output 3 on" in expected("output")
