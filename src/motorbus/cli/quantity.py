"""Values of registers as people type and read them; the units themselves are `core/units.py`.

A value is in the unit of its row. What a raw value means may depend on a device's settings too (a servo can count
velocity in two units), so where the device can convert, it does.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from motorbus.core import units
from motorbus.errors import LimitExceeded, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from motorbus.core.register import Register, Value


class Typed(NamedTuple):
    """What was typed for a row: a number, whether it is raw, and whether it was a choice called by its name."""

    number: Value
    raw: bool
    named: bool = False


def typed(entry: Register, text: str, *, raw: bool = False) -> Typed:
    """A choice by its name, `2048raw`, or a number in the row's unit or with a unit of its own.

    Raises RequestError when it is none of these, or not finite.
    """
    named = {name.casefold(): number for number, name in entry.choices.items()}
    if text.casefold() in named:
        return Typed(named[text.casefold()], True, True)
    number = text.strip().removesuffix("raw")
    if raw or number != text.strip():
        return Typed(_whole(entry, number, text), True)
    if entry.unit in units.QUANTITIES:
        return Typed(units.parse(text, units.QUANTITIES[entry.unit]), False)
    return Typed(_whole(entry, text, text), True)


def _whole(entry: Register, number: str, text: str) -> int:
    try:
        return units.whole(number)
    except ValueError:
        kind = "a whole number" if number == text else "a whole number and `raw`, as 2048raw"
        raise RequestError(
            f"{entry.name}: {text!r} is not {kind}",
            expected=", ".join(entry.choices.values()) or f"{entry.low} to {entry.high}",
            advice="nothing was sent",
        ) from None


def to_value(one: Any, entry: Register, raw: int) -> Value:
    """Raw value -> value in the row's unit, by the settings of this device."""
    value: Value = one.value(entry, raw) if hasattr(one, "value") else entry.to_value(raw)
    return value


def to_raw(one: Any, entry: Register, value: Value) -> int:
    """Value in the row's unit -> raw value, by the settings of this device."""
    raw: int = one.raw(entry, value) if hasattr(one, "raw") else entry.to_raw(value)
    return raw


@contextmanager
def as_typed(words: Mapping[int, str]) -> Iterator[None]:
    """Name what was typed for a device in the error that refuses its goal."""
    try:
        yield
    except (LimitExceeded, RequestError) as error:
        nodes = list(words) if error.node is None else [error.node]
        if len(nodes) == 1 and nodes[0] in words:
            error.summary = f"{words[nodes[0]]}: {error.summary}"
        raise


def shown(number: Value | None, unit: str) -> str:
    """A value for eyes; an angle in degrees too, because that is what people see."""
    if number is None:
        return ""
    if unit in units.QUANTITIES:
        return units.show(number, units.QUANTITIES[unit])
    return f"{number} {unit}".rstrip()


def meaning(entry: Register, raw: int) -> str:
    """What a raw value says in words: its choice, or the bits that are set."""
    if raw in entry.choices:
        return entry.choices[raw]
    return ", ".join(name for bit, name in entry.bits.items() if raw >> bit & 1)
