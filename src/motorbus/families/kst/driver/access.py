"""Read and write objects by name, in API units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.access import readable_rows, writable_values
from motorbus.core.register import Register, Storage, Value
from motorbus.core.request import Effect
from motorbus.errors import DeviceError, UnexpectedReply
from motorbus.families.kst.driver.motion import send_target, setpoint, target
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.requests import is_absent, read_register, write_register
from motorbus.families.kst.driver.settings import store

METHODS: Final[Mapping[str, str]] = {
    "node_id": "set_node_id(), or provision(), which also verifies it after the restart",
    "bit_rate_code": "set_bit_rate(), or provision(), which also verifies it after the restart",
    "store": "save()",
    "mid_point": "set_mid_point()",
    "function_enable": "set_reversed(), which changes its one known bit and leaves the others",
}
"""The device methods that write protected rows."""


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Objects in API units by name; without a name all that this servo has.

    Raises RequestError for an unknown or write-only name, DeviceError for a named object that the servo refuses.
    """
    raws = await read_raw(node, *names)
    return {name: node.table[name].to_value(raw) for name, raw in raws.items()}


async def read_raw(node: Node, /, *names: str) -> dict[str, int]:
    """Objects as raw values by name; see `read`."""
    found: dict[str, int] = {}
    for row in readable_rows(node.table, names):
        request = read_register(node, row, int, reports_position=row.name == "present_position")
        try:
            found[row.name] = await request
        except (DeviceError, UnexpectedReply) as error:
            if names or not (is_absent(error) or isinstance(error, UnexpectedReply)):
                raise
    return found


async def write(node: Node, /, **values: Value) -> None:
    """Write objects by name, in API units; all values are checked before the first is sent.

    A value that survives power-off is written by `store`. Raises RequestError for what cannot be written by name,
    LimitExceeded for a target outside the limits.
    """

    def to_raw(row: Register, value: Value) -> int:
        return target(node, value) if row.effect is Effect.MOTION else node.raw(row, value)

    raws = writable_values(node.table, values, to_raw, node=node.node, methods=METHODS)
    stored = [(row, raw) for row, raw in raws if row.storage is Storage.EEPROM]
    if stored:
        await store(node, stored)
    for row, raw in raws:
        if row.effect is Effect.MOTION:
            await send_target(node, await setpoint(node, raw))
        elif row.storage is not Storage.EEPROM:
            await write_register(node, row, raw)
