"""Writing what survives power-off: write, read back, save, wait for the flash, read back again.

These servos have no lock; the danger is another one. A save is not answered (the manual), so nothing tells that it
was heard; requests during the write to flash are lost or answered with passing values, so the node is left alone
for a while; and some writes fail or are undone. Only what reads back is said to be written, and only what reads back
after a restart is said to be saved: `provision` does that, for it alone waits for one.
Source: KST CAN protocol manual, command 3; a public flight-controller driver for the wait, the reading back and its
three tries.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motorbus.core.register import Register
from motorbus.core.request import Effect, Priority, Request, TimeoutClass
from motorbus.core.steps import Exclusive, Sleep
from motorbus.errors import NoReply, VerificationFailed, WireError, unread
from motorbus.families.kst import wire
from motorbus.families.kst.driver.exchanges import STORE, decided, listening, order, refused, upload_row
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.table import SAVE
from motorbus.families.kst.wire import SdoReply

TRIES: Final = 3
LISTEN: Final = 0.020
"""s after a save in which an acknowledgement or a refusal may come; the manual says that none does."""


async def save(node: Node) -> None:
    """Keep node id, bit rate, travel limits and function bits over power-off; never the goal position.

    No answer is expected; one that comes is taken, and a refusal raises DeviceError. The servo is left alone until its
    flash has been written. That it has saved shows only after a restart.
    """
    await decided(node)
    await save_exchange(node)


def save_exchange(node: Node) -> Request[None]:
    """The save alone; it holds the lane of this node for the listening time and the write to flash."""
    row = node.table["store"]
    data = row.encode(SAVE)

    def take(replies: list[SdoReply], at: float) -> None:
        node.at = at
        for reply in replies:
            if reply.kind == "abort" and reply.index in (STORE, 0):
                raise refused(node, reply, row.address, row.subindex or 0)

    frame = wire.encode_download(
        node.node,
        row.address,
        row.subindex or 0,
        data,
        sized=node.dialect.states_length(node.node),
        extended=node.dialect.extended(node.node),
    )
    return listening(node, frame, take, timeout=TimeoutClass.STORE, effect=Effect.PERSISTENT)


async def keep(node: Node, orders: Sequence[tuple[Register, int]]) -> None:
    """Write these rows, read back, save, read back again; nobody else is on the bus meanwhile.

    They are read first. When all of them hold this already, nothing is written and nothing saved, for flash wears;
    unless this node has written one of them and has not come to its save. What others wrote and did not save reads just
    the same, and so does what a save that got lost has left: `save()` keeps it, and only a restart shows what is kept.

    Raises VerificationFailed when a row reads back different after three tries, or after the save.
    """
    node.limits = None
    try:
        await Exclusive(_kept(node, orders))
    finally:
        node.limits = None


async def _kept(node: Node, orders: Sequence[tuple[Register, int]]) -> None:
    names = {row.name for row, _ in orders}
    if names.isdisjoint(node.unsaved) and await _alike(node, orders):
        return
    node.unsaved |= names
    for row, raw in orders:
        await verified(node, row, raw)
    await checked(node, orders)  # together, for one may have changed another
    await save(node)
    await settled(node)
    await checked(node, orders)
    node.unsaved -= names


async def _alike(node: Node, orders: Sequence[tuple[Register, int]]) -> bool:
    """Whether all of these rows can be read, and hold this."""
    for row, raw in orders:
        if not row.readable or await upload_row(node, row, int) != raw:
            return False
    return True


async def settled(node: Node) -> None:
    """Wait on where this servo's make needs longer than the bus waits after a save anyway."""
    rest = node.profile.mid_point_wait - node.profile.flash_wait
    if rest > 0:
        await Sleep(rest)


async def verified(node: Node, row: Register, raw: int) -> None:
    """Write a row and read it back, three times at most; what cannot be read is written once."""
    for attempt in range(TRIES):
        await order(node, row, raw, priority=Priority.CONFIGURATION)
        if not row.readable:
            return
        try:
            await checked(node, [(row, raw)])
        except VerificationFailed:
            if attempt == TRIES - 1:
                raise
        else:
            return


async def checked(node: Node, orders: Sequence[tuple[Register, int]]) -> None:
    """Read these rows back. Raises VerificationFailed when one differs, OutcomeUnknown when it cannot be read."""
    for row, raw in orders:
        if row.readable:
            try:
                found = await upload_row(node, row, int)
            except (NoReply, WireError) as error:
                raise unread(error, node=node.node, what=f"the write of {row.name}") from error
            if found != raw:
                raise _differs(node, row, raw, found)


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
