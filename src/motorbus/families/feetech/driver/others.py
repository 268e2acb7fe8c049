"""Who else is on a bus before an id is written to, and who would obey that write without a word.

An HLS servo hears writes to its second id and does not show in any answer to it (HLS memory table), so every servo that
answers is asked for one. A servo whose own id is torn appears under the one as shipped, so that is looked at as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motorbus.core.request import TimeoutClass
from motorbus.core.steps import Emit, Progress, catch
from motorbus.errors import LinkLost, NoReply, RequestError
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.driver.identity import identity_of
from motorbus.families.feetech.driver.jobs import SHIPPED_ID
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.table import TABLES

_HEAD: Final = 5


async def others_than(node: Node, asked: Sequence[int], ids: Sequence[int]) -> list[int]:
    """Who else is on this bus, of these ids and the one as shipped, where a servo may appear whose own is torn; the
    silent ones are asked twice. A servo whose second id is one of `ids` raises RequestError."""
    others = []
    asked = list(dict.fromkeys((*asked, SHIPPED_ID)))
    for done, id in enumerate(asked):
        await Emit(Progress(done + 1, len(asked), f"who else is there? id {id}"))
        if id == node.node:
            continue
        head = await catch(_head(id))
        if isinstance(head, NoReply):
            head = await catch(_head(id))
        if isinstance(head, LinkLost):
            raise head
        if isinstance(head, NoReply):
            continue
        others.append(id)
        if isinstance(head, bytes):
            await _refuse_second(id, head, ids)
    return others


async def _head(id: int) -> bytes:
    return await read_block(Node(id), 0, _HEAD, bytes, timeout=TimeoutClass.SCAN)


async def _refuse_second(id: int, head: bytes, ids: Sequence[int]) -> None:
    table = TABLES.get(identity_of(id, head).table)
    if table is None or "second_id" not in table:
        return
    row = table["second_id"]
    second = await read_block(Node(id), row.address, row.size, row.decode)
    if second in ids and second != id:
        raise RequestError(
            f"servo {id} has {second} as its second id: it would obey every write to {second} without a word",
            expected="no servo whose second id is one of " + " and ".join(map(str, ids)),
            cause="HLS servos hear writes to a second id (register 7)",
            advice=f"take servo {id} off the bus; nothing was written",
            node=id,
        )
