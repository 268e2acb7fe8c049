"""A machine as a fresh file: every key a person may want to change, in their units, with its meaning beside it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import isfinite
from typing import Any, Final

from motorbus.core import units
from motorbus.motion.machine import keys, reading
from motorbus.motion.machine.keys import Key
from motorbus.motion.machine.model import FORMAT, AxisSpec, Description

HEAD: Final = (
    "# A machine: its buses, what moves on them, and how far and how fast it may.",
    "# Angles, lengths and velocities have a unit, in quotes.",
)
LONG: Final = 16
"""Characters; a number with its unit of this length was not written by a person."""
COLUMN: Final = 30
"""Before it no comment begins, so that those of most lines stand below each other."""


def write(machine: Description) -> str:
    """The text of a file that `reading.read` makes the same machine of. Raises RequestError where none does."""
    text = "\n".join(_lines(machine)) + "\n"
    reading.read(text)
    return text


def _lines(machine: Description) -> Iterator[str]:
    yield from HEAD
    yield f"format = {FORMAT}"
    if machine.name:
        yield f"name = {quoted(machine.name)}"
    for place, (name, bus) in enumerate(machine.buses.items()):
        yield from ("", f"[bus.{name}]")
        yield _line("address", quoted(bus.address), keys.BUS["address"].says if place == 0 else "")
    told: set[str] = set()
    for name, axis in machine.axes.items():
        yield from ("", f"[axis.{name}]", *_axis(axis, told))
    for name, group in machine.groups.items():
        yield from ("", f"[group.{name}]", f"axes = [{', '.join(map(quoted, group.axes))}]")
    for name, pose in machine.poses.items():
        yield from ("", f"[pose.{name}]")
        for moved, position in pose.items():
            yield f"{moved} = {_value(position, keys.POSE, machine.axes.get(moved))}"


def _axis(axis: AxisSpec, told: set[str]) -> Iterator[str]:
    """The lines of one axis; what a key means is said where it first stands."""
    for key in keys.AXIS.values():
        value = getattr(axis, key.name)
        if value is None or (key.kind is bool and value == key.default):
            continue
        yield _line(key.name, _value(value, key, axis), "" if key.name in told else key.says)
        told.add(key.name)


def _line(name: str, value: str, says: str) -> str:
    line = f"{name} = {value}"
    return f"{line:<{COLUMN}}  # {says}" if says else line


def _value(value: Any, key: Key, axis: AxisSpec | None) -> str:
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, bool):
        return keys.word(value)
    if key.measure is None or axis is None or not isfinite(value):
        return str(value)
    quantity = key.measure.of(axis.linear)
    unit = _unit(quantity, axis.unit)
    return quoted(quantity_text(value, quantity, unit)) if unit else str(value)


def quantity_text(value: float, quantity: str, unit: str) -> str:
    """Text of a value in the API unit: the fewest digits in `unit` that `units.parse` reads as the same number.

    In the API unit where no digits in `unit` do, or where that text is long (16 characters) and the API unit shorter,
    as for 2 rad.
    """
    plain = f"{_plain(value)} {next(iter(units.SCALES[quantity]))}"
    number = value / units.SCALES[quantity][unit]
    for digits in range(1, 18):
        text = f"{_plain(float(f'{number:.{digits}g}'))} {unit}"
        if units.parse(text, quantity) == value:
            return text if len(text) < LONG or len(text) <= len(plain) else plain
    return plain


def _plain(number: float) -> str:
    return repr(number).removesuffix(".0")


def _unit(quantity: str, seen: str) -> str:
    """The unit to write a quantity in, for people who see positions in `seen`; "" for a plain number."""
    if quantity == "load":
        return ""
    for unit in (seen, f"{seen}/s", f"{seen}/s2", "deg", "mm"):
        if unit in units.SCALES[quantity]:
            return unit
    return keys.api_unit(quantity)


def quoted(text: str) -> str:
    """Text as TOML has it, whatever is in it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
