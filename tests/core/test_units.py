"""Numbers with units as people write them, converted to the unit of the API and back."""

from __future__ import annotations

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.units import SCALES, parse, rate, real, show, whole
from motorbus.errors import RequestError


@pytest.mark.parametrize(
    ("text", "quantity", "value"),
    [
        ("90deg", "position", pi / 2),
        ("-45°", "position", -pi / 4),
        ("1.2", "position", 1.2),
        ("1.2rad", "position", 1.2),
        ("0.25turn", "position", pi / 2),
        (" +.5 rad ", "position", 0.5),
        ("30rpm", "velocity", pi),
        ("180 deg/s", "velocity", pi),
        ("1turn/s", "velocity", 2 * pi),
        ("10rad/s²", "acceleration", 10.0),
        ("30 mm", "length", 0.03),
        ("250 µm", "length", 0.00025),
        ("50 mm/s", "linear velocity", 0.05),
        ("1 m/s²", "linear acceleration", 1.0),
        ("150mA", "current", 0.15),
        ("7.4V", "voltage", 7.4),
        ("70°C", "temperature", 70.0),
        ("50ms", "time", 0.05),
        ("80%", "load", 0.8),
    ],
)
def test_a_number_with_or_without_a_unit(text: str, quantity: str, value: float) -> None:
    assert parse(text, quantity) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "quantity", "says"),
    [
        ("", "position", "is empty"),
        ("nan", "position", "is not a number"),
        ("inf", "position", "is not a number"),
        ("1e999", "position", "too large"),
        ("deg", "position", "is not a number"),
        ("90grad", "position", "'grad', which is not known"),
        ("30rpm", "position", "measures velocity and not position"),
        ("50 mm/s", "velocity", "measures linear velocity and not velocity"),
        ("1,5", "position", "decimal comma"),
        ("100raw", "position", "raw value"),
        ("٣", "position", "is not a number"),
    ],
)
def test_what_cannot_be_meant_is_refused(text: str, quantity: str, says: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse(text, quantity)
    assert says in caught.value.summary
    assert repr(text) in caught.value.summary
    assert "nothing was sent" in caught.value.advice


@pytest.mark.parametrize(
    ("value", "quantity", "text"),
    [
        (pi / 2, "position", "1.5708 rad (90.0°)"),
        (pi, "velocity", "3.142 rad/s (30.0 rpm)"),
        (0.0305, "length", "30.500 mm"),
        (0.15, "current", "0.150 A"),
        (7.4, "voltage", "7.4 V"),
        (0.294, "load", "29.4 %"),
        (1.5, "time", "1.5 s"),
        (0.00016, "time", "160 µs"),
    ],
)
def test_values_for_people(value: float, quantity: str, text: str) -> None:
    assert show(value, quantity) == text


@given(st.text(max_size=12), st.sampled_from(sorted(SCALES)))
def test_no_text_gives_anything_but_a_number_or_our_error(text: str, quantity: str) -> None:
    try:
        value = parse(text, quantity)
    except RequestError:
        return
    assert abs(value) < float("inf")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("500000", 500_000),
        (500_000, 500_000),
        ("500k", 500_000),
        ("0.5M", 500_000),
        ("1M", 1_000_000),
        ("0x10", 16),
    ],
)
def test_a_rate_is_spelled_in_one_way_everywhere(text: object, value: int) -> None:
    assert rate(text) == value


@pytest.mark.parametrize(
    "text", ["", "fast", "0", "-1", "0k", "-1M", "1m", "1.5", "0.0001k", "1/2", "nan", "1e6", "kk"]
)
def test_what_is_no_rate_is_refused(text: str) -> None:
    with pytest.raises(RequestError, match="is not a rate"):
        rate(text)


@pytest.mark.parametrize(
    ("text", "value"), [("37", 37), ("0x25", 37), ("-3", -3), ("0b101", 5), (" 7", 7), ("0", 0)]
)
def test_a_whole_number_is_decimal_or_says_its_base(text: str, value: int) -> None:
    assert whole(text) == value
    assert real(str(value)) == value
