"""Conversion between quantities as text (`90deg`, `30rpm`, `5 mm`) and numbers in API units.

The API has one unit per quantity: rad, rad/s, rad/s², A, V, °C, s, a fraction for load, and m, m/s, m/s² for linear
axes. A number without a unit is in the API unit. Raw counts are not a quantity.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite, pi
from typing import Final

from motorbus.errors import RequestError

DEGREE = pi / 180
TURN = 2 * pi
RPM = TURN / 60

SCALES: Mapping[str, Mapping[str, float]] = {
    "position": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "°": DEGREE, "turn": TURN, "turns": TURN},
    "velocity": {"rad/s": 1.0, "deg/s": DEGREE, "°/s": DEGREE, "rpm": RPM, "turn/s": TURN, "turns/s": TURN},
    "acceleration": {
        **dict.fromkeys(("rad/s²", "rad/s2", "rad/s^2"), 1.0),
        **dict.fromkeys(("deg/s²", "deg/s2", "deg/s^2", "°/s²", "°/s2"), DEGREE),
        **dict.fromkeys(("turn/s²", "turn/s2"), TURN),
    },
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6},
    "linear velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "mm/min": 1e-3 / 60},
    "linear acceleration": {
        **dict.fromkeys(("m/s²", "m/s2", "m/s^2"), 1.0),
        **dict.fromkeys(("mm/s²", "mm/s2", "mm/s^2"), 1e-3),
    },
    "current": {"A": 1.0, "mA": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "temperature": {"°C": 1.0, "degC": 1.0, "C": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0},
    "load": {"fraction": 1.0, "%": 0.01},
}
"""By quantity and unit, the value of one unit in the API unit, which is the first one."""

QUANTITIES: Mapping[str, str] = {next(iter(units)): quantity for quantity, units in SCALES.items()}
"""The quantity of each API unit, which is also the unit of a table row."""

MIN_RATE: Final = 1e-6  # Hz of a cyclic operation: one cycle in 11.6 days
MAX_RATE: Final = 1e6  # Hz; one byte takes longer than such a cycle on the fastest bus

_MILLIMETRES = {"length": "mm", "linear velocity": "mm/s", "linear acceleration": "mm/s²"}
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_FACTORS = {"k": 1000, "M": 1_000_000}


def parse(text: str, quantity: str) -> float:
    """`90deg`, `-45°`, `0.25 turn`, `1.2` -> number in the API unit of `quantity` (a key of `SCALES`).

    Raises RequestError for text without a number, a number that is not finite, an unknown unit, a unit of another
    quantity, and raw counts.
    """
    scales = SCALES[quantity]
    stripped = text.strip()
    number = _NUMBER.match(stripped)
    if number is None:
        raise _refused(text, quantity, "is not a number" if stripped else "is empty")
    unit = stripped[number.end() :].strip()
    scale = scales.get(unit) if unit else 1.0
    if scale is None:
        folded = (known for name, known in scales.items() if name.lower() == unit.lower())
        scale = next(folded, None)
    if scale is None:
        raise _refused(text, quantity, _unit_fault(unit, quantity))
    value = float(number[0]) * scale
    if not isfinite(value):
        raise _refused(text, quantity, "is too large to be a number")
    return value


def whole(text: str) -> int:
    """`37`, `0x25`, `-3`, `0b101` -> int.

    Raises ValueError for other text, also for `1_0` and digits of other scripts, which Python accepts.
    """
    return int(_checked(text), 0)


def real(text: str) -> float:
    """`0.5`, `-3`, `1e-3` -> float. Raises ValueError as `whole` does."""
    return float(_checked(text))


def _checked(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number")
    return text


LONG: Final = 1e6  # `show` gives six significant digits from this size on; a float may have 300


def show(value: float, quantity: str) -> str:
    """Text of a value in the API unit, for people: with the digits that matter for a motor, and the unit."""
    if abs(value) >= LONG:
        return f"{value:.6g} {next(iter(SCALES[quantity]))}"
    if quantity == "position":
        return f"{value:.4f} rad ({value / DEGREE:.1f}°)"
    if quantity == "velocity":
        return f"{value:.3f} rad/s ({value / TURN * 60:.1f} rpm)"
    if quantity == "load":
        return f"{value * 100:.1f} %"
    if quantity == "time":
        for unit, scale in (("s", 1.0), ("ms", 1e-3)):
            if abs(value) >= scale or not value:
                return f"{value / scale:.4g} {unit}"
        return f"{value / 1e-6:.4g} µs"
    if quantity in _MILLIMETRES:
        return f"{value * 1000:.3f} {_MILLIMETRES[quantity]}"
    decimals = {"acceleration": 2, "current": 3, "voltage": 1, "temperature": 0}[quantity]
    return f"{value:.{decimals}f} {next(iter(SCALES[quantity]))}"


def _unit_fault(unit: str, quantity: str) -> str:
    if unit == "raw":
        return "is a raw value, and a quantity is wanted"
    if unit.startswith(",") and unit[1:2].isdigit():
        return "has a decimal comma; write a point"
    for name, scales in SCALES.items():
        if unit in scales:
            return f"has the unit {unit!r}, which measures {name} and not {quantity}"
    return f"has the unit {unit!r}, which is not known"


def _refused(text: str, quantity: str, what: str) -> RequestError:
    units = ", ".join(SCALES[quantity])
    return RequestError(
        f"{quantity} {text!r} {what}",
        expected=f"a number, or a number with one of {units}",
        advice="nothing was sent",
    )


def rate(text: object) -> int:
    """`500000`, `500k`, `0.5M` -> bit/s, for addresses and flags.

    Raises RequestError for text that is not a whole number of bit/s above 0.
    """
    stripped = str(text).strip()
    factor = _FACTORS.get(stripped[-1:], 1)
    try:
        found = real(stripped[:-1]) * factor if factor > 1 else whole(stripped)
    except ValueError:
        found = 0
    if not (0 < found < LONG * LONG and found == int(found)):
        raise RequestError(
            f"{text} is not a rate", expected="bit/s, as 500000, 500k or 1M", advice="nothing was sent"
        )
    return int(found)
