"""Registers of a device and what they hold, as plain data and as rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.cli import quantity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.cli.output import Output
    from motorbus.core.entry import Entry, Value

BRIEF = ("register", "value", ">raw", "meaning")
FULL = ("register", ">address", "value", ">raw", "meaning", "storage", "access")


def facts(one: Any, entries: Iterable[Entry], values: Mapping[str, Value]) -> list[dict[str, Any]]:
    """What these registers of a device hold, as plain data."""
    return [
        _facts(entry, values[entry.name], quantity.to_raw(one, entry, values[entry.name]))
        for entry in entries
    ]


def _facts(entry: Entry, value: Value, raw: int) -> dict[str, Any]:
    return {
        "name": entry.name,
        "address": entry.address,
        "value": value,
        "unit": entry.unit,
        "raw": raw,
        "meaning": quantity.meaning(entry, raw),
        "storage": entry.storage.value,
        "access": entry.access.value,
    }


def show(title: str, rows: Iterable[Mapping[str, Any]], output: Output, *, full: bool = False) -> None:
    """The same as a table."""
    names = FULL if full else BRIEF
    keys = ["name" if name == "register" else name.removeprefix(">") for name in names]
    cells = [{**row, "value": quantity.shown(row["value"], row["unit"])} for row in rows]
    output.table(title, names, [[row[key] for key in keys] for row in cells])
