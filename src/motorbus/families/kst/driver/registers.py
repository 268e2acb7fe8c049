"""Objects by name: read and write them in API units.

A write goes the way its row asks for: a goal through the gate, RAM at once, what is kept through the guarded sequence
of `keeping.py`. All values are checked before the first is sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.register import Register, Storage, Value
from motorbus.core.request import Effect
from motorbus.errors import DeviceError, RequestError
from motorbus.families.kst.driver.exchanges import ABSENT, OtherSize, meant, order, ready, upload_row
from motorbus.families.kst.driver.keeping import keep
from motorbus.families.kst.driver.motion import counts, goal_of, send_goal
from motorbus.families.kst.driver.node import Node

VERBS: Final[Mapping[str, str]] = {
    "node_id": "set_node_id(), or provision(), which also verifies it after the restart",
    "bit_rate_code": "set_bit_rate(), or provision(), which also verifies it after the restart",
    "store": "save()",
    "mid_point": "set_mid_point()",
    "function_enable": "set_reversed(), which changes its one known bit and leaves the others",
}
"""What writes a protected row."""


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Objects in API units by name; all that this servo tells when none is named.

    Raises RequestError for an unknown name or one that can only be written (nothing is sent then), DeviceError for a
    named object that the servo refuses; unnamed ones that it lacks are left out.
    """
    raws = await read_raw(node, *names)
    return {name: node.value(node.table[name], raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str) -> dict[str, int]:
    """Objects as raw values by name; all that this servo tells when none is named. Raises as `read`."""
    rows = [_readable(node.table[name]) for name in names] or [
        row for row in node.table.values() if row.readable
    ]
    found: dict[str, int] = {}
    for row in rows:
        try:
            found[row.name] = await raw_of(node, row)
        except (DeviceError, OtherSize) as error:
            if names or (isinstance(error, DeviceError) and meant(error.code) not in ABSENT):
                raise
    return found


async def raw_of(node: Node, row: Register) -> int:
    """The raw value of one object."""
    return await ready(node, lambda same: upload_row(same, row, int, reports_position=_tells(row)))


def _tells(row: Register) -> bool:
    return row.name == "present_position"


def _readable(row: Register) -> Register:
    if row.readable:
        return row
    raise RequestError(f"{row.name} can only be written", advice="nothing was sent")


async def write(node: Node, /, **values: Value) -> None:
    """Write objects by name, in API units; all are checked before the first is sent.

    What survives power-off is read back, saved and read back again. Raises RequestError for what cannot or must not be
    written so, LimitExceeded for a goal outside the limits, VerificationFailed when it reads back different.
    """
    orders = [(row, _checked(node, row, values[row.name])) for row in map(node.table.__getitem__, values)]
    kept = [(row, raw) for row, raw in orders if row.storage is Storage.EEPROM]
    if kept:
        await keep(node, kept)
    for row, raw in orders:
        if row.effect is Effect.MOTION:
            await send_goal(node, await goal_of(node, raw))
        elif row.storage is not Storage.EEPROM:
            await order(node, row, raw)


def _checked(node: Node, row: Register, value: Value) -> int:
    """The raw value to write. Raises RequestError when this may not be written by name."""
    refusal = ""
    if not row.writable:
        refusal = "it can only be read"
    elif row.protected:
        refusal = f"use {VERBS[row.name]}"
    if refusal:
        raise RequestError(
            f"{row.name} is not written by name: {refusal}", advice="nothing was sent", node=node.node
        )
    raw = counts(node, value) if row.effect is Effect.MOTION else node.raw(row, value)
    row.encode(raw, row.given(value))  # raises when it is out of range
    return raw
