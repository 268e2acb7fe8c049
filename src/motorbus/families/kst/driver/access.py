"""Read and write objects by name, and settings that survive power-off.

A save has no reply, requests during the write to flash are lost or answered with transitional values, and some writes
fail or are undone. So a setting is written, read back, saved, and read back again; that it is saved shows after a
restart only. Source: KST CAN protocol manual, command 3; a public autopilot driver for the wait and the reading
back. The manual has no mid point and no reverse bit: a profile without them raises RequestError and names others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

from motorbus.core.access import check_written, readable_rows, writable_values, write_verified
from motorbus.core.register import Register, Storage, Value
from motorbus.core.request import Effect, Priority
from motorbus.core.steps import Exclusive, Sleep
from motorbus.errors import DeviceError, UnexpectedReply
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.motion import MOVE, target
from motorbus.families.kst.driver.node import Node, feature_row
from motorbus.families.kst.driver.requests import is_absent, read_position, read_row, save, write_row
from motorbus.families.kst.profiles import REVERSED

MID_POINT_TIME: Final = 0.5  # s that a servo needs after a new mid point; source: public XQPOWER tools

METHODS: Final[Mapping[str, str]] = {
    "node_id": "set_id()",
    "bit_rate_code": "set_baud()",
    "store": "save()",
    "mid_point": "set_mid_point()",
    "function_enable": "set_reversed(), which changes its one known bit and leaves the others",
}
"""The device methods that write protected rows."""
CAUSE: Final = (
    "the servo does not take this value; a write failed, which is known of these servos; or the sense of rotation is "
    "reversed, and a change of one travel limit changes the other"
)
ADVICE: Final = "for limits: set_reversed(False) first, or give symmetric ones"


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
        is_position = row.name == "present_position"
        try:
            found[row.name] = await (read_position(node, int) if is_position else read_row(node, row, int))
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
            await MOVE.send(node, await MOVE.check(node, values[row.name]))
        elif row.storage is not Storage.EEPROM:
            await write_row(node, row, raw)


async def store(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    """Write these rows, read them back, save, and read them back again, with the bus reserved.

    Rows that read so already are only saved: another program may have written them without a save. Raises
    VerificationFailed when a row reads back different after three tries, or after the save.
    """

    def about(row: Register) -> dict[str, Any]:
        return {"node": node.node, "what": row.name, "cause": CAUSE, "advice": ADVICE}

    async def check_all() -> None:
        for row, raw in values:
            await check_written(partial(read_row, node, row, int), raw, **about(row))

    async def write_and_save() -> None:
        node.limits = None
        for row, raw in values:
            read = partial(read_row, node, row, int)
            if await read() != raw:
                write = partial(write_row, node, row, raw, priority=Priority.CONFIGURATION)
                await write_verified(write, read, raw, **about(row))
        await check_all()  # one may have changed another
        await save(node)
        await check_all()

    await Exclusive(write_and_save())


async def set_mid_point(node: Node) -> float:
    """Make the present position the zero and save it; return the position (rad) read afterwards, about 0.

    No source says whether the servo then moves to its old target: keep clear, and send a target next. The request is
    never repeated: OutcomeUnknown says that the servo may have received it.
    """
    row = feature_row(node, "mid_point", "mid point")

    async def write_and_save() -> float:
        node.limits = None
        await write_row(node, row, node.profile.mid_point_value, priority=Priority.CONFIGURATION)
        await save(node)
        await Sleep(MID_POINT_TIME)
        return await position(node)

    return await Exclusive(write_and_save())


async def reversed_(node: Node) -> bool:
    """Whether the sense of rotation is reversed."""
    row = feature_row(node, "function_enable", "reverse bit")
    return bool(await read_row(node, row, int) >> REVERSED & 1)


async def set_reversed(node: Node, on: bool) -> None:
    """Reverse the sense of rotation, or not; the other bits of that object, which are unknown, are kept.

    A restart may undo it: read reversed() after one. No source says whether the servo moves to its old target: keep
    clear.
    """
    row, bit = feature_row(node, "function_enable", "reverse bit"), 1 << REVERSED

    async def read_modify_write() -> None:
        raw = await read_row(node, row, int)
        await store(node, [(row, raw | bit if on else raw & ~bit)])

    await Exclusive(read_modify_write())
