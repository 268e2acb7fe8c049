"""Presence, identity and node id of a servo.

No servo reports its maker or model, so its model is the profile of the bus. Source: KST CAN protocol manual, commands
2, 4 and 8.
"""

from __future__ import annotations

from motorbus.core.family import Identity
from motorbus.core.register import Register
from motorbus.core.request import Request
from motorbus.errors import DeviceError, NoReply, UnexpectedReply
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.requests import ask_presence, is_absent, read_row
from motorbus.families.kst.profiles import VERSIONS, version_text


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
