"""Identity, node id and bit rate of a servo, and whether one servo or two answer to an id.

No servo reports its maker or model, so its model is the profile of the bus. A node id or bit rate written here takes
effect after a save and a restart, and no command restarts a servo: `provision` does all of it. Source: KST CAN protocol
manual, commands 1, 2, 4 and 8.

Two servos with one id reply at slightly different times, which gives two replies, or at the same time: equal replies
then merge into one frame, unequal ones break each other. So several objects that seldom agree are read again and
again, and bus errors meanwhile count as a second servo. Most slcan adapters report no bus errors: there, a position
that never comes from a servo whose id always comes counts as two.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.family import IdChanged, Identity
from motorbus.core.register import Register
from motorbus.core.request import Notification, Priority, Request
from motorbus.core.steps import Emit, Exclusive, WaitFor, catch, gather
from motorbus.errors import DeviceError, MotorbusError, NoReply, RequestError, VerificationFailed
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.node import Node, checked_id, hexadecimal
from motorbus.families.kst.driver.requests import (
    FIRMWARE,
    NODE_ID,
    POSITION,
    ask_presence,
    collect,
    is_absent,
    read_all_bytes,
    read_register,
    write_register,
)
from motorbus.families.kst.profiles import BIT_RATES, bit_rate_code, version_text
from motorbus.families.kst.sdo import SdoReply

ROUNDS: Final = 3
OBJECTS: Final = (NODE_ID, POSITION, FIRMWARE)
"""Two servos may agree on the id, and seldom on position and version."""
ERROR_TIME: Final = 0.5
"""s in which bus errors count; about the time that all reads of a survey take."""


async def ping(node: Node) -> bool:
    """Whether a servo answers; an abort is an answer."""
    try:
        await ask_presence(node)
    except NoReply:
        return False
    return True


async def identify(node: Node) -> Identity:
    """The profile as model, the version ("unknown" when the servo refuses it), and the id that it reads back."""
    reads_back = await _read_if_allowed(node, node.table["node_id"])
    try:
        firmware = await version(node)
    except DeviceError:
        firmware = "unknown"
    details = {
        "profile": node.profile.name,
        "id_format": "ext" if node.settings.extended else "std",
        "reads_back_id": reads_back,
    }
    return Identity(node.node, node.profile.title, firmware, node.profile.name, details)


async def version(node: Node) -> str:
    """The firmware version as text, from 0x100A or where newer firmware has it; as hex where it is no text.

    Raises DeviceError when the servo has none of these objects.
    """
    first: DeviceError | None = None
    for row in node.profile.version_rows:
        try:
            return version_text(await read_all_bytes(node, row))
        except DeviceError as error:
            if not is_absent(error):
                raise
            first = first or error
    assert first is not None
    raise first


async def _read_if_allowed(node: Node, row: Register) -> int | None:
    """The raw value, or None when the servo refuses it."""
    found = await catch(read_register(node, row, int))
    if isinstance(found, DeviceError):
        return None
    if isinstance(found, MotorbusError):
        raise found
    return found


# -- node id ---------------------------------------------------------------------------------------------------


def node_id(node: Node) -> Request[int]:
    """The id that it reads back: its own, or after set_node_id() the one after the next save and restart."""
    return read_register(node, node.table["node_id"], int)


async def set_node_id(node: Node, new: int) -> None:
    """Give it another id, 1 to 127: it takes effect after save() and a restart, and is lost at one without a save.

    Raises RequestError for another new id (nothing is sent), two servos with this id or an id in use (nothing is
    written); NoReply; VerificationFailed when it reads back neither. To swap two ids, give one of them a third one
    first.
    """
    checked_id(new)
    if not await Exclusive(answers_alone(node)):
        await ask_presence(node)  # raises NoReply
    if new != node.node and (await look(Node(new, node.settings))).answered:
        raise id_taken(node.node, new)
    await write_node_id(node, new)


def id_taken(old: int, new: int) -> RequestError:
    """The error for a new id at which a servo answers."""
    return RequestError(
        f"the id {hexadecimal(new)} is taken: a servo answers as it beside {hexadecimal(old)}",
        cause="after a restart both would answer to one id, and neither could be addressed alone",
        advice="choose a free id, or take that servo off the bus; nothing was written",
        node=new,
    )


async def write_node_id(node: Node, new: int) -> None:
    """As `set_node_id`, without the checks of both ids."""
    row = node.table["node_id"]
    await Emit(IdChanged(node.node, new))
    await write_register(node, row, new, priority=Priority.CONFIGURATION)
    found = await _read_if_allowed(node, row)
    if found not in (None, new, node.node):  # some servos read back the id in force
        raise VerificationFailed(
            f"node {node.node} was set to {new} and reads back {found}",
            sent=bytes((new,)),
            expected=f"{new}, or {node.node} until the restart",
            cause="two servos with one id, or another program",
            advice="do not save; restart it, and the old id is in force again",
            node=node.node,
        )


# -- bit rate --------------------------------------------------------------------------------------------------


async def bit_rate(node: Node) -> int | None:
    """The rate (bit/s) after the next restart; None where the servo does not report it: the manual has no read."""
    try:
        code = await read_register(node, node.table["bit_rate_code"], int)
    except NoReply:
        await ask_presence(node)  # raises NoReply when there is no servo
        return None
    except DeviceError as error:
        if not is_absent(error):
            raise
        return None
    return BIT_RATES.get(code)


def set_bit_rate(node: Node, rate: int) -> Request[None]:
    """Give it another bit rate (bit/s): it takes effect after save() and a restart, and is lost at a restart without.

    Raises RequestError for a rate that these servos do not have.
    """
    return write_register(
        node, node.table["bit_rate_code"], bit_rate_code(rate), priority=Priority.CONFIGURATION
    )


# -- one servo or two ------------------------------------------------------------------------------------------


class Presence(NamedTuple):
    """Result of reading an id: time (s), most replies to one request, the id read back, bus errors meanwhile.

    `torn`: the id came every time and the position never, as when two unequal replies break each other.
    """

    at: float
    most: int
    reads_back: int | None = None
    errors: bool = False
    torn: bool = False

    @property
    def answered(self) -> bool:
        return self.most > 0

    @property
    def several(self) -> bool:
        """More than one servo replied, or some replies broke. If all broke, the bit rate may be wrong."""
        return self.most > 1 or self.torn or (self.errors and self.answered)


def look(node: Node, index: int = NODE_ID) -> Request[Presence]:
    """Read an object once and count the replies; silence is a result."""

    def take(replies: list[SdoReply], at: float) -> Presence:
        mine = [reply for reply in replies if reply.index in (index, 0)]
        ids = [reply.data[0] for reply in mine if reply.kind == "upload" and index == NODE_ID]
        return Presence(at, len(mine), ids[0] if ids else None)

    return collect(node, sdo.encode_upload(node.node, index, extended=node.settings.extended), take)


async def survey(node: Node) -> Presence:
    """Read several objects several times and watch for bus errors. Run it with the bus reserved."""
    found, error = await gather(_look_often(node), WaitFor(is_bus_error, ERROR_TIME))
    return found._replace(errors=error is not None)


async def _look_often(node: Node) -> Presence:
    most, reads_back = 0, None
    counts = dict.fromkeys(OBJECTS, 0)
    for index in OBJECTS * ROUNDS:
        found = await look(node, index)
        most = max(most, found.most)
        counts[index] += found.answered
        reads_back = found.reads_back or reads_back
    torn = counts[NODE_ID] == ROUNDS and not counts[POSITION]
    return Presence(found.at, most, reads_back, torn=torn)


async def answers_alone(node: Node) -> bool:
    """Whether a servo answers to this id. Raises RequestError when two do. Run it with the bus reserved."""
    found = await survey(node)
    if not found.several:
        return found.answered
    signs = "its id comes every time, its position never"
    if found.most > 1:
        signs = f"{found.most} answers to one request"
    elif found.errors:
        signs = "bus errors whenever it is asked"
    raise RequestError(
        f"two servos answer as {hexadecimal(node.node)}: {signs}",
        cause="servos are shipped with one id, and both obey what is sent to it; or the bus is disturbed",
        advice="connect one servo at a time, provision it, then the next; nothing was written",
        node=node.node,
    )


def is_bus_error(notification: Notification) -> bool:
    """Whether the adapter reports a bus error."""
    return notification.kind == "bus error"
