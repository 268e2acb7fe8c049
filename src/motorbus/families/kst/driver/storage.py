"""Write values that survive power-off: write, read back, save, wait for the flash, read back again.

These servos have no EEPROM lock. A save has no reply (manual), requests during the write to flash are lost or
answered with transitional values, and some writes fail or are undone. So a value counts as written when it reads
back, and as saved when it reads back after a restart, which only `provision` waits for. Source: KST CAN protocol
manual, command 3; a public flight-controller driver for the wait, the reading back, three tries.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from motorbus.core import verify
from motorbus.core.register import Register
from motorbus.core.request import ANY, Effect, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Exclusive
from motorbus.errors import VerificationFailed
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.requests import decoded, read_register, refused, write_register
from motorbus.families.kst.profiles import SAVE

LISTEN: Final = 0.020
"""s after a save in which an acknowledgement or an abort is accepted; the manual says that neither comes."""


def save(node: Node) -> Request[None]:
    """Store node id, bit rate, travel limits and function bits; never the target position.

    The request holds the lane of the node for `LISTEN` and the write to flash. No reply is expected; an abort raises
    DeviceError. Whether the values are stored shows after a restart only.
    """
    row = node.table["store"]

    def decode(answer: Response) -> None:
        node.at = answer.at
        for reply in decoded(answer):
            if reply.kind == "abort" and reply.index in (row.address, 0):
                raise refused(node, row, reply)

    return Request(
        node.settings.download(node.node, row, SAVE),
        ANY,
        decode,
        lane=node.node,
        priority=Priority.CONFIGURATION,
        effect=Effect.PERSISTENT,
        reply_within=TimeoutClass.STORE,
    )


async def store(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    """Write these rows, read them back, save, and read them back again, with the bus reserved.

    If all rows read as wanted and this node has written none of them since its last save, nothing is written, because
    flash wears. Raises VerificationFailed when a row reads back different after three tries, or after the save.
    """
    names = {row.name for row, _ in values}

    async def check(row: Register, raw: int) -> None:
        await verify.check(
            partial(read_register, node, row, int),
            raw,
            node=node.node,
            what=row.name,
            differs=partial(_differs, node, row, raw),
        )

    async def write_and_save() -> None:
        node.limits = None
        if names.isdisjoint(node.unsaved) and await _reads_as(node, values):
            return
        node.unsaved |= names
        for row, raw in values:
            await verify.write_verified(
                partial(write_register, node, row, raw, priority=Priority.CONFIGURATION),
                partial(read_register, node, row, int),
                raw,
                node=node.node,
                what=row.name,
                differs=partial(_differs, node, row, raw),
            )
        for row, raw in values:  # one may have changed another
            await check(row, raw)
        await save(node)
        for row, raw in values:
            await check(row, raw)
        node.unsaved -= names

    await Exclusive(write_and_save())


async def _reads_as(node: Node, values: Sequence[tuple[Register, int]]) -> bool:
    for row, raw in values:
        if await read_register(node, row, int) != raw:
            return False
    return True


def _differs(node: Node, row: Register, raw: int, found: int) -> VerificationFailed:
    cause = "the servo does not take this value, or a write failed, which is known of these servos"
    if row.name.endswith("_limit"):
        cause = (
            "while the sense of rotation is reversed a change of one travel limit changes the other too: "
            "set_reversed(False) first, or give symmetric limits"
        )
    return VerificationFailed(
        f"node {node.node}: {row.name} reads back {found}, not {raw}",
        expected=f"raw {raw}",
        cause=cause,
        advice="read it again, then write it again; until it reads back right do not rely on it",
        node=node.node,
    )
