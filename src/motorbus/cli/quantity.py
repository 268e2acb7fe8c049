"""Values of registers as people type and read them; the units themselves are `core/units.py`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motorbus.core import units
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.core.entry import Entry, Value


def value(entry: Entry, text: str) -> Value:
    """What was typed for a row, in the row's unit: a choice by its name, `2048raw`, or a number with or without unit.

    Raises RequestError when it is none of these.
    """
    named = {name.casefold(): raw for raw, name in entry.choices.items()}
    if text.casefold() in named:
        return entry.to_value(named[text.casefold()])
    raw = units.raw(text)
    if raw is not None:
        return entry.to_value(raw)
    if entry.unit in units.QUANTITIES:
        return units.parse(text, units.QUANTITIES[entry.unit])
    return _number(entry, text)


def _number(entry: Entry, text: str) -> Value:
    try:
        return int(text, 0)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        raise RequestError(
            f"{entry.name}: {text!r} is not a number",
            expected=", ".join(entry.choices.values()) or f"{entry.low} to {entry.high}",
            advice="nothing was sent",
        ) from None


def shown(number: Value | None, unit: str) -> str:
    """A value for eyes; an angle in degrees too, because that is what people see."""
    if number is None:
        return ""
    if unit in units.QUANTITIES:
        return units.show(number, units.QUANTITIES[unit])
    return f"{number} {unit}".rstrip()


def meaning(entry: Entry, raw: int) -> str:
    """What a raw value says in words: its choice, or the bits that are set."""
    if raw in entry.choices:
        return entry.choices[raw]
    return ", ".join(name for bit, name in entry.bits.items() if raw >> bit & 1)
