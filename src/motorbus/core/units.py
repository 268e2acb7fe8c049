"""Quantities as people type and read them, and as the API takes them.

The API knows one unit per quantity (rad, rad/s, rad/s², A, V, °C, s, a plain fraction for load, and m, m/s, m/s² for
what a linear axis does), so that numbers can be passed on without asking. People say `90deg`, `30rpm` and `5 mm`; this
is where the one becomes the other, and nowhere else. A number without a unit is in the API's unit. Raw counts are
another thing than a quantity and are only ever taken as such: see `raw`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from math import isfinite, pi
from typing import Final

from motorbus.errors import RequestError

DEGREE = pi / 180
TURN = 2 * pi

SCALES: Mapping[str, Mapping[str, float]] = {
    "position": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "°": DEGREE, "turn": TURN, "turns": TURN},
    "velocity": {
        "rad/s": 1.0,
        "deg/s": DEGREE,
        "°/s": DEGREE,
        "rpm": TURN / 60,
        "turn/s": TURN,
        "turns/s": TURN,
    },
    "acceleration": {
        "rad/s²": 1.0,
        "rad/s2": 1.0,
        "rad/s^2": 1.0,
        "deg/s²": DEGREE,
        "deg/s2": DEGREE,
        "deg/s^2": DEGREE,
        "°/s²": DEGREE,
        "°/s2": DEGREE,
        "turn/s²": TURN,
        "turn/s2": TURN,
    },
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6},
    "linear velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "mm/min": 1e-3 / 60},
    "linear acceleration": {
        "m/s²": 1.0,
        "m/s2": 1.0,
        "m/s^2": 1.0,
        "mm/s²": 1e-3,
        "mm/s2": 1e-3,
        "mm/s^2": 1e-3,
    },
    "current": {"A": 1.0, "mA": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "temperature": {"°C": 1.0, "degC": 1.0, "C": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0},
    "load": {"%": 0.01, "fraction": 1.0},
}
"""For each quantity, what one of each unit is in the API's unit. The API's unit has 1; load needs none."""

QUANTITIES: Mapping[str, str] = {
    "rad": "position",
    "rad/s": "velocity",
    "rad/s²": "acceleration",
    "m": "length",
    "m/s": "linear velocity",
    "m/s²": "linear acceleration",
    "A": "current",
    "V": "voltage",
    "°C": "temperature",
    "s": "time",
    "fraction": "load",
}
"""Which quantity a unit of the API (the unit of a table row) measures."""

LEAST_RATE: Final = 1e-6
"""Hz of anything that goes on in cycles: one in eleven days."""
GREATEST_RATE: Final = 1e6
"""Hz; on the quickest bus there is one byte takes longer than such a cycle."""

_MILLIMETRES = {"length": "mm", "linear velocity": "mm/s", "linear acceleration": "mm/s²"}
_LONG = 16
"""Characters; a number with its unit that has as many is no number that a person wrote."""
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_RATE = re.compile(r"(\d+(?:\.\d+)?)([kM])", re.ASCII)
_FACTORS = {"k": 1000, "M": 1_000_000}
_RAW = re.compile(r"([+-]?(?:0[xX][0-9a-fA-F]+|\d+))\s*raw", re.ASCII)


def parse(text: str, quantity: str) -> float:
    """`90deg`, `-45°`, `0.25 turn`, `1.2` -> the API's unit of `quantity` (a key of `SCALES`).

    Raises RequestError for text without a number, a number that is not finite, a unit that is not known or
    measures something else, and for raw counts.
    """
    scales = SCALES[quantity]
    stripped = text.strip()
    number = _NUMBER.match(stripped)
    if number is None:
        raise _refused(text, quantity, "is not a number" if stripped else "is empty")
    unit = stripped[number.end() :].strip()
    value = float(number[0]) * _scale(text, unit, quantity, scales)
    if not isfinite(value):
        raise _refused(text, quantity, "is too large to be a number")
    return value


def raw(text: str) -> int | None:
    """`100raw` or `0x64 raw` -> 100; None when the text does not say that it is a raw value.

    Raises RequestError when it says so and is not a whole number.
    """
    stripped = text.strip()
    if not stripped.endswith("raw"):
        return None
    match = _RAW.fullmatch(stripped)
    if match is None:
        raise RequestError(
            f"{text!r} is not a raw value",
            expected="a whole number followed by raw, such as 2048raw",
            advice="nothing was sent",
        )
    return int(match[1], 16 if "x" in match[1].lower() else 10)


def whole(text: str) -> int:
    """A whole number as people type it: `37`, `0x25`, `-3`, `0b101`.

    Raises ValueError for anything else, also for what Python itself would take: `1_0`, and digits of other scripts.
    """
    return int(_plainly(text), 0)


def real(text: str) -> float:
    """A number as people type it: `0.5`, `-3`, `1e-3`. Raises ValueError as `whole` does."""
    return float(_plainly(text))


def _plainly(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number")
    return text


LONG: Final = 1e6
"""A number from here on is shown in six digits: nobody reads more, and there may be three hundred."""


def show(value: float, quantity: str) -> str:
    """A value in the API's unit, for people: enough digits for a motor and no more, with its unit."""
    if abs(value) >= LONG:
        return f"{value:.6g} {next(iter(SCALES[quantity]))}"
    if quantity == "position":
        return f"{value:.4f} rad ({value / DEGREE:.1f}°)"
    if quantity == "velocity":
        return f"{value:.3f} rad/s ({value / TURN * 60:.1f} rpm)"
    if quantity == "load":
        return f"{value * 100:.1f} %"
    if quantity == "time":
        return _show_time(value)
    if quantity in _MILLIMETRES:
        return f"{value * 1000:.3f} {_MILLIMETRES[quantity]}"
    decimals = {"acceleration": 2, "current": 3, "voltage": 1, "temperature": 0}[quantity]
    return f"{value:.{decimals}f} {next(iter(SCALES[quantity]))}"


def written(value: float, quantity: str, unit: str) -> str:
    """A value in the API's unit, for a file: the fewest digits in `unit` that `parse` reads as the same number.

    In the API's own unit where that is shorter by far, as 2 rad is, or where no digits in `unit` do. Raises KeyError
    for a unit that is none of `quantity`.
    """
    api = next(name for name, scale in SCALES[quantity].items() if scale == 1.0)
    own, plain = _fewest(value, quantity, unit), f"{_plain(value)} {api}"
    return own if own and (len(own) < _LONG or len(own) <= len(plain)) else plain


def _fewest(value: float, quantity: str, unit: str) -> str:
    number = value / SCALES[quantity][unit]
    for digits in range(1, 18):
        text = f"{_plain(float(f'{number:.{digits}g}'))} {unit}"
        if parse(text, quantity) == value:
            return text
    return ""


def _plain(number: float) -> str:
    return repr(number).removesuffix(".0")


def _show_time(value: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e-3)):
        if abs(value) >= scale or not value:
            return f"{value / scale:.4g} {unit}"
    return f"{value / 1e-6:.4g} µs"


def _scale(text: str, unit: str, quantity: str, scales: Mapping[str, float]) -> float:
    if not unit:
        return 1.0
    if unit in scales:
        return scales[unit]
    for name, scale in scales.items():
        if name.lower() == unit.lower():
            return scale
    if unit == "raw":
        raise _refused(text, quantity, "is a raw value, and a quantity is wanted")
    if unit.startswith(",") and unit[1:2].isdigit():
        raise _refused(text, quantity, "has a decimal comma; write a point")
    raise _refused(text, quantity, f"has the unit {unit!r}, {_other(unit, quantity)}")


def _other(unit: str, quantity: str) -> str:
    for name, scales in SCALES.items():
        if unit in scales:
            return f"which measures {name} and not {quantity}"
    return "which is not known"


def _refused(text: str, quantity: str, what: str) -> RequestError:
    units = ", ".join(SCALES[quantity])
    return RequestError(
        f"{quantity} {text!r} {what}",
        expected=f"a number, or a number with one of {units}",
        advice="nothing was sent",
    )


def rate(text: object) -> int:
    """`500000`, `500k`, `0.5M` -> bit/s; the one spelling of rates, in addresses and in flags.

    Raises RequestError for what is no whole number of bit/s above 0.
    """
    said = str(text).strip()
    short = _RATE.fullmatch(said)
    try:
        found = Fraction(short[1]) * _FACTORS[short[2]] if short else Fraction(whole(said))
    except ValueError:
        found = Fraction(0)
    if found <= 0 or found.denominator != 1:
        raise RequestError(
            f"{text} is not a rate", expected="bit/s, as 500000, 500k or 1M", advice="nothing was sent"
        )
    return int(found)
