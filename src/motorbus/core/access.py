"""Read and write registers by name: the checks that come before anything is sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from motorbus.core.register import Register, RegisterMap, Value
from motorbus.errors import RequestError


def readable_rows(table: RegisterMap, names: tuple[str, ...]) -> list[Register]:
    """The rows of these names; () means all that can be read. Raises RequestError for an unknown or write-only row."""
    if not names:
        return [row for row in table.values() if row.readable]
    rows = [table[name] for name in names]
    for row in rows:
        if not row.readable:
            raise RequestError(f"{row.name} can only be written", advice="nothing was sent")
    return rows


def writable_values(
    table: RegisterMap,
    values: Mapping[str, Value],
    to_raw: Callable[[Register, Value], int],
    *,
    node: int,
    methods: Mapping[str, str],
) -> list[tuple[Register, int]]:
    """These rows with their raw values, in order.

    `methods` names the device method that writes a protected row. Raises RequestError for an unknown, read-only or
    protected row, and for a value out of range.
    """
    found = []
    for name, value in values.items():
        row = table[name]
        if row.protected or not row.writable:
            refusal = f"use {methods[name]}" if row.writable else "it can only be read"
            raise RequestError(
                f"{name} is not written by name: {refusal}", advice="nothing was sent", node=node
            )
        raw = to_raw(row, value)
        row.encode(raw, row.given(value))
        found.append((row, raw))
    return found
