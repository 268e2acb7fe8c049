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
from motorbus.core.request import Effect, Priority, Request, TimeoutClass
from motorbus.core.steps import Exclusive, Sleep
from motorbus.errors import VerificationFailed
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.requests import STORE, collect, read_register, refused, write_register
from motorbus.families.kst.profiles import SAVE
from motorbus.families.kst.sdo import SdoReply

LISTEN: Final = 0.020
"""s after a save in which an acknowledgement or an abort is accepted; the manual says that neither comes."""


def save(node: Node) -> Request[None]:
    """Store node id, bit rate, travel limits and function bits; never the target position.

    The request holds the lane of the node for `LISTEN` and the write to flash. No reply is expected; an abort raises
    DeviceError. Whether the values are stored shows after a restart only.
    """
    row = node.table["store"]
    index, subindex = row.address, row.subindex or 0

    def take(replies: list[SdoReply], at: float) -> None:
        node.at = at
        for reply in replies:
            if reply.kind == "abort" and reply.index in (STORE, 0):
                raise refused(node, reply, index, subindex)

    frame = sdo.encode_download(
        node.node,
        index,
        subindex,
        row.encode(SAVE),
        sized=node.settings.sized,
        extended=node.settings.extended,
    )
    return collect(
        node,
        frame,
        take,
        reply_within=TimeoutClass.STORE,
        effect=Effect.PERSISTENT,
        priority=Priority.CONFIGURATION,
    )


async def store(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    """Write these rows, read them back, save, and read them back again, with the bus reserved.

    If all rows read as wanted and this node has written none of them since its last save, nothing is written, because
    flash wears. Raises VerificationFailed when a row reads back different after three tries, or after the save.
    """
    node.limits = None
    try:
        await Exclusive(_store(node, values))
    finally:
        node.limits = None


async def _store(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    names = {row.name for row, _ in values}
    if names.isdisjoint(node.unsaved) and await _reads_as(node, values):
        return
    node.unsaved |= names
    for row, raw in values:
        await _write_verified(node, row, raw)
    await _check(node, values)  # together: one may have changed another
    await save(node)
    await wait_after_save(node)
    await _check(node, values)
    node.unsaved -= names


async def _reads_as(node: Node, values: Sequence[tuple[Register, int]]) -> bool:
    for row, raw in values:
        if not row.readable or await read_register(node, row, int) != raw:
            return False
    return True


async def wait_after_save(node: Node) -> None:
    """Wait for the rest of the time that this maker's servos need beyond the time-out of a save."""
    rest = node.profile.mid_point_wait - node.profile.flash_wait
    if rest > 0:
        await Sleep(rest)


async def _write_verified(node: Node, row: Register, raw: int) -> None:
    write = partial(write_register, node, row, raw, priority=Priority.CONFIGURATION)
    if not row.readable:
        await write()
        return
    await verify.write_verified(
        write,
        partial(read_register, node, row, int),
        raw,
        node=node.node,
        what=row.name,
        differs=partial(_differs, node, row, raw),
    )


async def _check(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    for row, raw in values:
        if row.readable:
            read, differs = partial(read_register, node, row, int), partial(_differs, node, row, raw)
            await verify.check(read, raw, node=node.node, what=row.name, differs=differs)


def _differs(node: Node, row: Register, raw: int, found: int) -> VerificationFailed:
    cause = "the servo does not take this value, or a write failed, which is known of these servos"
    if row.name.endswith("_limit"):
        cause = (
            "while the sense of rotation is reversed a change of one travel limit changes the other too: "
            "set_reversed(False) first, or give symmetric limits"
        )
    return VerificationFailed(
        f"node {node.node}: {row.name} reads back {found}, not {raw}",
        sent=row.encode(raw),
        received=row.encode(found) if row.low <= found <= row.high else b"",
        expected=f"raw {raw}",
        cause=cause,
        advice="read it again, then write it again; until it reads back right do not rely on it",
        node=node.node,
    )
