"""Identity, node id and bit rate of a servo, and whether one servo or two answer to an id.

No servo reports its maker or model, so its model is the profile of the bus. A node id or bit rate written here takes
effect after a save and a restart: `provision` does all of it. Source: KST CAN protocol manual, commands 1, 2, 4 and 8.

Two servos with one id send two replies. If they send at the same time, equal replies merge into one and unequal replies
destroy each other. So several objects that seldom agree are read repeatedly, and bus errors meanwhile count as a second
servo. Most slcan adapters report no bus errors: there, an id whose position never arrives counts as two.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.family import IdChanged, Identity
from motorbus.core.register import Register
from motorbus.core.request import ANY, Notification, Priority, Request, Response
from motorbus.core.steps import Emit, Exclusive, WaitFor, gather
from motorbus.errors import DeviceError, NoReply, RequestError, UnexpectedReply, VerificationFailed
from motorbus.families.kst.driver.node import Node, checked_id, hexadecimal
from motorbus.families.kst.driver.requests import (
    ask_presence,
    decoded,
    is_absent,
    read_register,
    write_register,
)
from motorbus.families.kst.profiles import BIT_RATES, bit_rate_code, version_text

ROUNDS: Final = 3
OBJECTS: Final = ("node_id", "present_position", "firmware_version")
"""Two servos may agree on the id, and seldom on position and version."""
ERROR_TIME: Final = 0.5  # s in which bus errors count; about the time that all reads of a survey take


async def ping(node: Node) -> bool:
    """Whether a servo answers; an abort is an answer."""
    try:
        await ask_presence(node)
    except NoReply:
        return False
    return True


async def identify(node: Node) -> Identity:
    """The profile as model, the version ("unknown" when the servo refuses it), and the id that it reads back."""
    reads_back = await _read_id(node)
    try:
        firmware = await version(node)
    except (DeviceError, UnexpectedReply):
        firmware = "unknown"
    name, id_format = node.profile.name, "ext" if node.settings.extended else "std"
    details = {"profile": name, "id_format": id_format, "reads_back_id": reads_back}
    return Identity(node.node, node.profile.title, firmware, name, details)


async def version(node: Node) -> str:
    """The firmware version (hex where it is no text), from 0x100A or 0x100B.

    Raises DeviceError without both, UnexpectedReply for one that comes in segments.
    """
    *rows, last = node.profile.version_rows
    for row in rows:
        try:
            return await _read_version(node, row)
        except DeviceError as error:
            if not is_absent(error):
                raise
    return await _read_version(node, last)


def _read_version(node: Node, row: Register) -> Request[str]:
    return read_register(node, row, lambda raw: version_text(raw.to_bytes(row.size, "little")))


async def _read_id(node: Node) -> int | None:
    """The id that it reads back, or None when the servo refuses it."""
    try:
        return await node_id(node)
    except DeviceError:
        return None


def node_id(node: Node) -> Request[int]:
    """The id that it reads back: its own, or after set_node_id() the one after the next save and restart."""
    return read_register(node, node.table["node_id"], int)


async def set_node_id(node: Node, new: int) -> None:
    """Give it another id, 1 to 127. It takes effect after save() and a restart; without a save, a restart discards it.

    Raises RequestError (nothing is written) for an impossible id, two servos with this id, or an id in use; NoReply;
    VerificationFailed when it reads back neither the old nor the new id. To swap two ids, use a third one.
    """
    checked_id(new)
    if not await Exclusive(answers_alone(node)):
        await ask_presence(node)  # raises NoReply
    if new != node.node and (await count_replies(Node(new, node.settings))).replies:
        raise id_taken(node.node, new)
    await write_node_id(node, new)


def id_taken(old: int, new: int) -> RequestError:
    """The error for a new id at which a servo answers."""
    return RequestError(
        f"the id {hexadecimal(new)} is taken: a servo answers as it beside {hexadecimal(old)}",
        advice="choose a free id, or take that servo off the bus",
        node=new,
    )


async def write_node_id(node: Node, new: int) -> None:
    """As `set_node_id`, without the checks of both ids."""
    await Emit(IdChanged(node.node, new))
    await write_register(node, node.table["node_id"], new, priority=Priority.CONFIGURATION)
    found = await _read_id(node)
    if found not in (None, new, node.node):  # some servos read back the id in force
        raise VerificationFailed(
            f"node {node.node} was set to {new} and reads back {found}",
            cause="two servos with one id, or another program",
            advice="do not save; restart it, and the old id is in force again",
            node=node.node,
        )


async def bit_rate(node: Node) -> int | None:
    """The rate (bit/s) after the next restart; None where the servo does not report it: the manual has no read."""
    try:
        return BIT_RATES.get(await read_register(node, node.table["bit_rate_code"], int))
    except NoReply:
        await ask_presence(node)  # raises NoReply when there is no servo
    except DeviceError as error:
        if not is_absent(error):
            raise
    return None


def set_bit_rate(node: Node, rate: int) -> Request[None]:
    """Give it another bit rate (bit/s). It takes effect after save() and a restart; without a save it is discarded.

    Raises RequestError for a rate that no servo has.
    """
    row = node.table["bit_rate_code"]
    return write_register(node, row, bit_rate_code(rate), priority=Priority.CONFIGURATION)


# -- one servo or two ------------------------------------------------------------------------------------------


class ReplyCount(NamedTuple):
    """Result of one read: the node, the number of replies, the id read back (None: not read), and the time (s)."""

    node: int
    replies: int
    reads_back: int | None
    at: float


def count_replies(node: Node, name: str = "node_id") -> Request[ReplyCount]:
    """Read an object once and count the replies; silence is a result."""
    row = node.table[name]

    def decode(answer: Response) -> ReplyCount:
        replies = [reply for reply in decoded(answer) if reply.index in (row.address, 0)]  # 0: some aborts
        ids = [reply.data[0] for reply in replies if reply.kind == "upload" and name == "node_id"]
        return ReplyCount(node.node, len(replies), ids[0] if ids else None, answer.at)

    return Request(node.settings.upload(node.node, row), ANY, decode, lane=node.node)


async def survey(node: Node) -> tuple[bool, str]:
    """Whether a servo answers, and the evidence that a second one does ("": none). Run it with the bus reserved."""

    async def read_often() -> dict[str, list[int]]:
        counts: dict[str, list[int]] = {name: [] for name in OBJECTS}
        for name in OBJECTS * ROUNDS:
            counts[name].append((await count_replies(node, name)).replies)
        return counts

    counts, error = await gather(read_often(), WaitFor(is_bus_error, ERROR_TIME))
    most = max(map(max, counts.values()))
    second = ""
    if most > 1:
        second = f"{most} answers to one request"
    elif most and error is not None:
        second = "bus errors while it was read"
    elif all(counts["node_id"]) and not any(counts["present_position"]):
        second = "every read of its id is answered, no read of its position"
    return most > 0, second


async def answers_alone(node: Node) -> bool:
    """Whether a servo answers to this id. Raises RequestError when two do. Run it with the bus reserved."""
    answered, second = await survey(node)
    if second:
        raise RequestError(
            f"two servos answer as {hexadecimal(node.node)}: {second}",
            cause="servos are shipped with one id, and both obey what is sent to it; or the bus is disturbed",
            advice="connect one servo at a time, provision it, then the next",
            node=node.node,
        )
    return answered


def is_bus_error(notification: Notification) -> bool:
    """Whether the adapter reports a bus error."""
    return notification.kind == "bus error"
