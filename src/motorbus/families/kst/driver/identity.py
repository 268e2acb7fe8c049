"""Who is there, and under which id and at which rate it will be next time.

No servo of this protocol tells its maker or model, so what it is taken for is the profile that was chosen. Id and bit
rate written here are in force after a save and a restart only, and there is no command that restarts: `provision`
guides through all of it. Source: KST CAN protocol manual, commands 1, 2, 4 and 8.
"""

from __future__ import annotations

from motorbus.core.family import IdChanged, Identity
from motorbus.core.register import Register
from motorbus.core.request import Priority
from motorbus.core.steps import Emit, Exclusive, catch
from motorbus.errors import DeviceError, MotorbusError, NoReply, RequestError, VerificationFailed
from motorbus.families.kst import table
from motorbus.families.kst.driver.exchanges import (
    ABSENT,
    answers,
    decided,
    meant,
    order,
    ready,
    upload_row,
    whole,
)
from motorbus.families.kst.driver.node import Node, checked_id, hexadecimal
from motorbus.families.kst.driver.presence import glance, single
from motorbus.families.kst.table import BIT_RATES

UNKNOWN = "unknown"


async def ping(node: Node) -> bool:
    """Is it there? A refusal is an answer; silence is the answer False."""
    try:
        await decided(node)
        await answers(node)
    except NoReply:
        return False
    return True


async def identify(node: Node) -> Identity:
    """The profile it is taken for, the version it tells ("unknown" when it refuses), and the id it reads back."""
    reads_back = await _if_told(node, node.table["node_id"])
    try:
        firmware = await version(node)
    except DeviceError:
        firmware = UNKNOWN
    extended = node.dialect.extended(node.node)
    details = {
        "profile": node.profile.name,
        "id_format": "ext" if extended else "std",
        "reads_back_id": reads_back,
    }
    return Identity(node.node, node.profile.title, firmware, node.profile.name, details)


async def version(node: Node) -> str:
    """The firmware version as text, from 0x100A or where newer firmware has it; as hex when it is no text.

    Text of more than four letters is taken in segments. Raises DeviceError when the servo has none of these objects.
    """
    refusal: DeviceError | None = None
    for row in node.profile.version_rows:
        try:
            return table.version(await whole(node, row))
        except DeviceError as error:
            if meant(error.code) not in ABSENT:
                raise
            refusal = refusal or error
    assert refusal is not None
    raise refusal


async def node_id(node: Node) -> int:
    """The id it reads back: its own, or after set_node_id() the one it will have after a save and a restart."""
    return await ready(node, lambda same: upload_row(same, same.table["node_id"], int))


async def set_node_id(node: Node, new: int) -> None:
    """Give it another id, 1 to 127; in force after save() and a restart, lost at a restart without.

    Looks first whether it is alone with its id. Raises RequestError for any other new id (nothing is sent), for two
    servos with one id and for an id that another servo has (nothing is written), NoReply for nobody,
    VerificationFailed when it reads back neither. To swap two ids, give one of them a third one first.
    """
    checked_id(new)
    if not await Exclusive(single(node)):
        await answers(node)  # which tells best that nobody is there
    await _free(Node(new, node.dialect), node)
    await write_node_id(node, new)


async def _free(new: Node, old: Node) -> None:
    """Raises RequestError when a servo answers as `new` already, unless that is the old id."""
    if new.node == old.node:
        return
    look = await glance(new)
    if look.there:
        raise RequestError(
            f"the id {hexadecimal(new.node)} is taken: a servo answers as it beside {hexadecimal(old.node)}",
            cause="after a restart both would answer to one id, and neither could be addressed alone",
            advice="choose a free id, or take that servo off the bus; nothing was written",
            node=new.node,
        )


async def write_node_id(node: Node, new: int) -> None:
    """As `set_node_id`, for who has looked already whether the servo is alone with its id."""
    row = node.table["node_id"]
    await Emit(IdChanged(node.node, new))
    await order(node, row, new, priority=Priority.CONFIGURATION)
    found = await _if_told(node, row)
    if found not in (
        None,
        new,
        node.node,
    ):  # its present id: what it will have does not show before the restart
        raise VerificationFailed(
            f"node {node.node} was told to be {new} and reads back {found}",
            sent=bytes((new,)),
            expected=f"{new}, or {node.node} until the restart",
            cause="two servos with one id, or another program",
            advice="do not save; restart it, and the old id is in force again",
            node=node.node,
        )


async def bit_rate(node: Node) -> int | None:
    """The rate (bit/s) it will have after a restart; None where that cannot be read: the manual has the write only.

    Raises NoReply when nobody is there.
    """
    await decided(node)
    try:
        code = await upload_row(node, node.table["bit_rate_code"], int)
    except NoReply:
        await answers(node)  # or is nobody there at all?
        return None
    except DeviceError as refusal:
        if meant(refusal.code) not in ABSENT:
            raise
        return None
    return BIT_RATES.get(code)


async def set_bit_rate(node: Node, rate: int) -> None:
    """Give it another bit rate (bit/s); in force after save() and a restart, lost at a restart without.

    Raises RequestError for a rate it cannot have (nothing is sent).
    """
    await order(node, node.table["bit_rate_code"], code_of(rate), priority=Priority.CONFIGURATION)


def code_of(rate: int) -> int:
    """The code of a bit rate; neither slcan's nor that of CiA 305. Raises RequestError for a rate without one."""
    for code, known in BIT_RATES.items():
        if known == rate and not isinstance(rate, bool):
            return code
    raise RequestError(
        f"{rate!r} bit/s is no rate of these servos",
        expected=f"one of {', '.join(map(str, BIT_RATES.values()))}",
        advice="nothing was sent",
    )


async def _if_told(node: Node, row: Register) -> int | None:
    """The raw value, or None when the servo refuses to tell."""
    await decided(node)
    found = await catch(upload_row(node, row, int))
    if isinstance(found, DeviceError):
        return None
    if isinstance(found, MotorbusError):
        raise found
    return found
