"""Who is there, and under which id and at which rate it will be next time.

No servo of this protocol tells its maker or model, so what it is taken for is the profile that was chosen. Id and bit
rate written here are in force after a save and a restart only, and there is no command that restarts: `provision`
guides through all of it. Source: KST CAN protocol manual, commands 1, 2, 4 and 8.
"""

from __future__ import annotations

from motorbus.core.entry import Entry
from motorbus.core.family import Identity, Readdressed
from motorbus.core.operation import Alone, Operation, Rank, Report, outcome
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


def ping(node: Node) -> Operation[bool]:
    """Is it there? A refusal is an answer; silence is the answer False."""
    try:
        yield from decided(node)
        yield from answers(node)
    except NoReply:
        return False
    return True


def identify(node: Node) -> Operation[Identity]:
    """The profile it is taken for, the version it tells ("unknown" when it refuses), and the id it reads back."""
    reads_back = yield from _if_told(node, node.table["node_id"])
    try:
        firmware = yield from version(node)
    except DeviceError:
        firmware = UNKNOWN
    extended = node.dialect.extended(node.node)
    details = {
        "profile": node.profile.name,
        "id_format": "ext" if extended else "std",
        "reads_back_id": reads_back,
    }
    return Identity(node.node, node.profile.title, firmware, node.profile.name, details)


def version(node: Node) -> Operation[str]:
    """The firmware version as text, from 0x100A or where newer firmware has it; as hex when it is no text.

    Text of more than four letters is taken in segments. Raises DeviceError when the servo has none of these objects.
    """
    refusal: DeviceError | None = None
    for row in node.profile.version_rows:
        try:
            return table.version((yield from whole(node, row)))
        except DeviceError as error:
            if meant(error.code) not in ABSENT:
                raise
            refusal = refusal or error
    assert refusal is not None
    raise refusal


def node_id(node: Node) -> Operation[int]:
    """The id it reads back: its own, or after set_node_id() the one it will have after a save and a restart."""
    return (yield from ready(node, lambda same: upload_row(same, same.table["node_id"], int)))


def set_node_id(node: Node, new: int) -> Operation[None]:
    """Give it another id, 1 to 127; in force after save() and a restart, lost at a restart without.

    Looks first whether it is alone with its id. Raises RequestError for any other new id (nothing is sent), for two
    servos with one id and for an id that another servo has (nothing is written), NoReply for nobody,
    VerificationFailed when it reads back neither. To swap two ids, give one of them a third one first.
    """
    checked_id(new)
    if not (yield from Alone(single(node))):
        yield from answers(node)  # which tells best that nobody is there
    yield from _free(Node(new, node.dialect), node)
    yield from write_node_id(node, new)


def _free(new: Node, old: Node) -> Operation[None]:
    """Raises RequestError when a servo answers as `new` already, unless that is the old id."""
    if new.node == old.node:
        return
    look = yield from glance(new)
    if look.there:
        raise RequestError(
            f"the id {hexadecimal(new.node)} is taken: a servo answers as it beside {hexadecimal(old.node)}",
            cause="after a restart both would answer to one id, and neither could be addressed alone",
            advice="choose a free id, or take that servo off the bus; nothing was written",
            node=new.node,
        )


def write_node_id(node: Node, new: int) -> Operation[None]:
    """As `set_node_id`, for who has looked already whether the servo is alone with its id."""
    row = node.table["node_id"]
    yield from Report(Readdressed(node.node, new))
    yield from order(node, row, new, rank=Rank.CONFIGURATION)
    found = yield from _if_told(node, row)
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


def bit_rate(node: Node) -> Operation[int | None]:
    """The rate (bit/s) it will have after a restart; None where that cannot be read: the manual has the write only.

    Raises NoReply when nobody is there.
    """
    yield from decided(node)
    try:
        code = yield from upload_row(node, node.table["bit_rate_code"], int)
    except NoReply:
        yield from answers(node)  # or is nobody there at all?
        return None
    except DeviceError as refusal:
        if meant(refusal.code) not in ABSENT:
            raise
        return None
    return BIT_RATES.get(code)


def set_bit_rate(node: Node, rate: int) -> Operation[None]:
    """Give it another bit rate (bit/s); in force after save() and a restart, lost at a restart without.

    Raises RequestError for a rate it cannot have (nothing is sent).
    """
    yield from order(node, node.table["bit_rate_code"], code_of(rate), rank=Rank.CONFIGURATION)


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


def _if_told(node: Node, row: Entry) -> Operation[int | None]:
    """The raw value, or None when the servo refuses to tell."""
    yield from decided(node)
    found = yield from outcome(upload_row(node, row, int))
    if isinstance(found, DeviceError):
        return None
    if isinstance(found, MotorbusError):
        raise found
    return found
