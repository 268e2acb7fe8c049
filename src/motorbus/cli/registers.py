"""Registers of a device and what they hold, as plain data and as rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.cli import faces, quantity
from motorbus.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from motorbus.cli.output import Output
    from motorbus.core.register import Register, Value

BRIEF = ("register", "value", ">raw", "meaning")
FULL = ("register", ">address", "value", ">raw", "meaning", "storage", "access")


def read_each(one: Any, names: Sequence[str]) -> tuple[dict[str, Value], dict[str, DeviceError]]:
    """These registers in API units, and the errors of those that the device refuses."""
    try:
        return dict(one.read(*names)), {}
    except DeviceError:
        values: dict[str, Value] = {}
        refused: dict[str, DeviceError] = {}
    for name in names:
        try:
            values |= one.read(name)
        except DeviceError as error:
            refused[name] = error
    return values, refused


def refusals(refused: Mapping[str, DeviceError]) -> dict[str, dict[str, str]]:
    """What the device refused, as plain data; nothing where it answered all."""
    return {"refused": {name: error.summary for name, error in refused.items()}} if refused else {}


def facts(one: Any, entries: Iterable[Register], values: Mapping[str, Value]) -> list[dict[str, Any]]:
    """What these registers of a device hold, as plain data."""
    meaning = faces.offer(one.bus.family.name, "meaning") or quantity.meaning
    return [
        _facts(entry, values[entry.name], quantity.to_raw(one, entry, values[entry.name]), meaning)
        for entry in entries
    ]


def _facts(
    entry: Register, value: Value, raw: int, meaning: Callable[[Register, int], str]
) -> dict[str, Any]:
    return {
        "name": entry.name,
        "address": entry.address,
        **({} if entry.subindex is None else {"subindex": entry.subindex}),
        "value": value,
        "unit": entry.unit,
        "raw": raw,
        "meaning": meaning(entry, raw),
        "storage": entry.storage.value,
        "access": entry.access.value,
    }


def show(title: str, rows: Iterable[Mapping[str, Any]], output: Output, *, full: bool = False) -> None:
    """The same as a table."""
    names = FULL if full else BRIEF
    keys = ["name" if name == "register" else name.removeprefix(">") for name in names]
    cells = [{**row, "address": _address(row), "value": _value(row)} for row in rows]
    output.table(title, names, [[row[key] for key in keys] for row in cells])


def _value(row: Mapping[str, Any]) -> str:
    """Nothing where the number is the raw one and words say what it means: letters and flags are no quantity."""
    opaque = row["meaning"] and not row["unit"] and row["value"] == row["raw"]
    return "" if opaque else quantity.shown(row["value"], row["unit"])


def _address(row: Mapping[str, Any]) -> str:
    if "subindex" not in row:
        return str(row["address"])
    return f"0x{row['address']:04X}:{row['subindex']:02X}"
