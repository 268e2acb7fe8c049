"""The second id of an HLS servo: writes to it are obeyed without a word, so it must be nobody else's id.

What it is as shipped is not known; one that is the id of the next new servo would follow that one in everything. It is
no id by which a servo is found, for nobody answers to it (HLS memory table), so an ordinary guarded write is enough.
"""

from __future__ import annotations

from collections.abc import Sequence

from motorbus.core.family import IdChanged
from motorbus.core.register import Register, RegisterMap
from motorbus.core.request import Effect
from motorbus.core.steps import Emit, SetBitrate
from motorbus.errors import RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver import eeprom
from motorbus.families.feetech.driver.exchanges import Block, read_block
from motorbus.families.feetech.driver.identity import writable
from motorbus.families.feetech.driver.jobs import Place
from motorbus.families.feetech.driver.node import Node, as_nodes, checked_id
from motorbus.families.feetech.driver.others import others_than
from motorbus.families.feetech.driver.placing import refuse_taken, whoever
from motorbus.families.feetech.driver.renaming import met_alone
from motorbus.families.feetech.driver.sharing import refuse_duplicates
from motorbus.families.feetech.table import TABLES

_ROW = "second_id"


async def second_id(node: Node) -> int:
    """The id whose writes this servo obeys besides those to its own. Raises RequestError where its map has none."""
    table = await writable(node)
    row = _row(node, table)
    return await read_block(node, row.address, row.size, row.decode)


async def set_second_id(node: Node, new: int, *, force: bool = False, among: Sequence[int] = ()) -> int:
    """Give this servo another second id, for good; its own id means that it has no other. Gives what it reads back.

    The servo goes limp. `among` are the ids that other servos on this bus may have; () means every one, which takes
    some seconds to ask. With `force` the second id may be one that others have: a write to it then reaches all of them.
    What it has already is not written again.

    Raises RequestError (nothing was written) for an impossible id, for maps without a second id, for an id that another
    servo answers to or has as its second id, unless `force`; two servos that seem to have the id of this one, or
    another that has it as its second id; DeviceError for a servo whose map is not known; VerificationFailed or
    OutcomeUnknown when it is not sure that the write has been kept.
    """
    checked_id(new)
    asked = [one.node for one in as_nodes(among or range(wire.MAX_ID + 1))]
    await met_alone(node)
    table = await writable(node)
    row = _row(node, table)
    if await read_block(node, row.address, row.size, row.decode) == new:
        return new
    await refuse_duplicates(node)
    if new != node.node and not force:
        refuse_taken(Place(new, await SetBitrate(0)), await whoever(new))
    await others_than(node, asked, (node.node,) if force else (new, node.node))
    await Emit(IdChanged(node.node, new))
    await eeprom.store(node, table, [Block(row.address, row.encode(new), Effect.PERSISTENT)])
    return new


def _row(node: Node, table: RegisterMap) -> Register:
    if _ROW in table:
        return table[_ROW]
    raise RequestError(
        f"node {node.node} has no second id: its register map is {table.name}",
        expected=f"a servo with one of the maps {', '.join(name for name, one in TABLES.items() if _ROW in one)}",
        advice="nothing was sent",
        node=node.node,
    )
