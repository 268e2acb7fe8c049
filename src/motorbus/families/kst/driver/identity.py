"""Who answers to an id: presence, identity, node id, and whether it is one servo or two.

No servo reports its maker or model, so its model is the profile of the bus. Source: KST CAN protocol manual, commands
2, 4 and 8.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import Identity
from motorbus.core.register import Register
from motorbus.core.request import ANY, Request, Response
from motorbus.errors import DeviceError, NoReply, RequestError, UnexpectedReply
from motorbus.families.kst.driver.node import Node, hexadecimal
from motorbus.families.kst.driver.requests import ask_presence, decoded, is_absent, read_row
from motorbus.families.kst.profiles import VERSIONS, version_text

ROUNDS: Final = 3


async def ping(node: Node) -> bool:
    """Whether a servo answers; an abort is an answer."""
    try:
        await ask_presence(node)
    except NoReply:
        return False
    return True


async def identify(node: Node) -> Identity:
    """The profile as model, the version ("unknown" when the servo refuses it), and the id that it reads back."""
    reads_back = await read_id(node)
    try:
        firmware = await version(node)
    except (DeviceError, UnexpectedReply):
        firmware = "unknown"
    name, id_format = node.profile.name, "ext" if node.settings.extended else "std"
    details = {"profile": name, "id_format": id_format, "reads_back_id": reads_back}
    return Identity(node.node, node.table.title, firmware, name, details)


async def version(node: Node) -> str:
    """The firmware version (hex where it is no text), from 0x100A or 0x100B.

    Raises DeviceError without both, UnexpectedReply for one that comes in segments.
    """
    *rows, last = (node.table[name] for name in VERSIONS if name in node.table)
    for row in rows:
        try:
            return await _read_version(node, row)
        except DeviceError as error:
            if not is_absent(error):
                raise
    return await _read_version(node, last)


def _read_version(node: Node, row: Register) -> Request[str]:
    return read_row(node, row, lambda raw: version_text(raw.to_bytes(row.size, "little")))


def node_id(node: Node) -> Request[int]:
    """The id that it reads back: its own, or after set_node_id() the one after the next save and restart."""
    return read_row(node, node.table["node_id"], int)


async def read_id(node: Node) -> int | None:
    """The id that it reads back, or None when the servo refuses it."""
    try:
        return await node_id(node)
    except DeviceError:
        return None


# -- one servo or two ------------------------------------------------------------------------------------------


def count_replies(node: Node, name: str = "node_id") -> Request[int]:
    """Read an object once; the number of replies, 0 for silence."""
    row = node.table[name]

    def decode(answer: Response) -> int:
        return sum(reply.index in (row.address, 0) for reply in decoded(answer))  # 0: some aborts

    return Request(node.settings.upload(node.node, row), ANY, decode, lane=node.node)


async def second_servo(node: Node) -> str | None:
    """The evidence that two servos answer to this id, "" for one, None for none.

    Two servos with one id send two replies. If both begin at the same time, equal replies merge into one and unequal
    ones destroy each other. So the id, which is equal, and the position, which seldom is, are read several times.
    """
    counts: list[int] = []
    for _ in range(ROUNDS):
        counts += [await count_replies(node, name) for name in ("node_id", "present_position")]
        if not any(counts):
            return None
    if max(counts) > 1:
        return f"{max(counts)} answers to one request"
    return "" if any(counts[1::2]) else "every read of its id is answered, no read of its position"


async def answers_alone(node: Node) -> bool:
    """Whether a servo answers to this id. Raises RequestError when two do. Run it with the bus reserved."""
    second = await second_servo(node)
    if second:
        raise RequestError(
            f"two servos answer as {hexadecimal(node.node)}: {second}",
            cause="servos are shipped with one id, and both obey what is sent to it; or the bus is disturbed",
            advice="connect one servo at a time, provision it, then the next",
            node=node.node,
        )
    return second is not None
