"""Read and write registers by name: the checks before anything is sent, and the check of what was written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar

from motorbus.core.register import Register, RegisterMap, Value
from motorbus.core.steps import Runnable
from motorbus.errors import NoReply, RequestError, VerificationFailed, WireError, unread

T = TypeVar("T")

TRIES: Final = 3  # of a write that reads back different


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


async def check_written(
    read: Callable[[], Runnable[T]], expected: T, *, node: int, what: str, cause: str = "", advice: str = ""
) -> None:
    """Read a value that was written. Raises VerificationFailed for another one, OutcomeUnknown without a reply."""
    try:
        found = await read()
    except (NoReply, WireError) as error:
        raise unread(error, node=node, what=f"the write of {what}") from error
    if found != expected:
        summary = f"node {node}: {what} reads back {found}, not {expected}"
        raise VerificationFailed(summary, cause=cause, advice=advice, node=node)


async def write_verified(
    write: Callable[[], Runnable[object]], read: Callable[[], Runnable[T]], expected: T, **about: Any
) -> None:
    """Write and read back, up to three times while the value differs; `about` and errors as for `check_written`."""
    for attempt in range(TRIES):
        await write()
        try:
            await check_written(read, expected, **about)
        except VerificationFailed:
            if attempt == TRIES - 1:
                raise
        else:
            return
