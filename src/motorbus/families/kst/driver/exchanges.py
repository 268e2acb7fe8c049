"""The exchanges everything else is made of: read an object, write one, hand a long one over in segments.

A reply is believed for its index and sub-index, on acknowledgements too; a refusal becomes a DeviceError in the
manual's words. Requests say 0x22, as the manual does, which leaves the length of the data to the object; a node that
refuses exactly this is written to in CiA 301's sized form from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register
from motorbus.core.request import ANY, Effect, Precondition, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive, Runnable
from motorbus.errors import DeviceError, NoReply, UnexpectedReply
from motorbus.families.kst import wire
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.wire import ABORTS, SdoReply, abort_text

T = TypeVar("T")

NODE_ID: Final = 0x3000
POSITION: Final = 0x6002
GOAL: Final = 0x6003
STORE: Final = 0x1010
MID_POINT: Final = 0x3009
UNSETTLING: Final = frozenset((MID_POINT, 0x300A, 0x300B, 0x300F))
"""Mid point, travel limits and function bits: a servo that holds its old target may set off when one is written (no
source tells), and positions read before a mid point or a reversal mean another place. So the gate, the latch and the
stop take such a write for a switch of the torque."""
UNSIZED_REFUSED: Final = frozenset((0x0504_0001, 0x0607_0010, 0x0607_0012, 0x0607_0013))
"""Refusals that may mean "state the length"."""
ABSENT: Final = frozenset((0x0601_0000, 0x0601_0001, 0x0602_0000, 0x0609_0011))
"""Refusals that mean "there is nothing to read here"."""
LONGEST: Final = 256
"""Bytes of a segmented value that are taken; a version text has a few dozen."""
GIVE_UP: Final = 0x0800_0000
"""What a client's abort says: general error."""


class OtherSize(UnexpectedReply):
    """The object is told in another size than its row has."""


def upload(
    node: Node,
    index: int,
    subindex: int,
    take: Callable[[SdoReply], T],
    *,
    priority: Priority = Priority.POLL,
    timeout: TimeoutClass = TimeoutClass.REPLY,
    reports_position: bool | Callable[[Response], Mapping[int, float]] = False,
) -> Request[T]:
    """Read an object; the value is what `take` makes of the reply. A refusal raises DeviceError."""

    def read(answer: Response) -> T:
        return take(told(node, answer, index, subindex))

    return _upload(node, index, subindex, read, priority, timeout, reports_position)


def _upload(
    node: Node,
    index: int,
    subindex: int,
    read: Callable[[Response], T],
    priority: Priority = Priority.POLL,
    timeout: TimeoutClass = TimeoutClass.REPLY,
    reports_position: bool | Callable[[Response], Mapping[int, float]] = False,
) -> Request[T]:
    return Request(
        wire.encode_upload(node.node, index, subindex, extended=node.dialect.extended(node.node)),
        (wire.upload_due(node.node, index, subindex),),
        read,
        lane=node.node,
        priority=priority,
        reply_within=timeout,
        repeatable=True,
        reports_position=reports_position,
    )


def upload_row(
    node: Node, row: Register, take: Callable[[int], T], *, reports_position: bool = False
) -> Request[T]:
    """Read a row of the table; the value is what `take` makes of its raw value.

    A reply that states the length of the row is read as it is; every other one is taken apart, which gives the same.
    """
    index, subindex = row.address, row.subindex or 0
    head, end = wire.usual_head(index, subindex, row.size), 4 + row.size

    def read(answer: Response) -> T:
        data = answer.replies[0].data
        if data[:4] == head and len(data) == wire.LENGTH:
            node.at = answer.at
            return take(row.decode(data[4:end]))
        return take(row.decode(sized(node, row, told(node, answer, index, subindex))))

    def places(answer: Response) -> dict[int, float]:
        reply = wire.decode_reply(answer.replies[0].data)
        if reply is None or reply.kind != "upload":  # a refusal tells nothing
            return {}
        return {node.node: float(row.to_value(row.decode(reply.data[: row.size])))}

    return _upload(node, index, subindex, read, reports_position=reports_position and places)


def sized(node: Node, row: Register, reply: SdoReply) -> bytes:
    """The bytes of this row in a reply. Raises OtherSize when it has fewer, announces segments, or says more.

    Bytes beyond the row say nothing where the reply does not state its length, and where they fill up with zeros or
    the sign; anything else is a longer number, of which these would be a wrong part.
    """
    own, more = reply.data[: row.size], reply.data[row.size :]
    filled = reply.size is None or more.strip(b"\0") == b"" or (own[-1] > 0x7F and more.strip(b"\xff") == b"")
    if reply.kind == "upload" and len(own) == row.size and filled:
        return own
    came = f"{reply.size} bytes in segments" if reply.kind == "upload-start" else f"{len(reply.data)} bytes"
    raise OtherSize(
        f"node {node.node} tells {row.name} in {came}, and not in {row.size}",
        received=reply.data,
        expected=f"{row.size} bytes",
        cause=f"its firmware is not of the profile {node.profile.name}",
        advice="choose the profile of its maker, as in kst:PORT,profile=kst-ext",
        node=node.node,
    )


def download(
    node: Node,
    row: Register,
    data: bytes,
    *,
    states_length: bool,
    goals: tuple[Setpoint, ...] = (),
    priority: Priority = Priority.CONTROL,
    refusal: Precondition | None = None,
) -> Request[None]:
    """Write a row once, in one of the two forms; the acknowledgement proves receipt, not more.

    A mid point is not written again in silence: the servo may stand elsewhere by then.
    """
    index, subindex = row.address, row.subindex or 0

    def read(answer: Response) -> None:
        told(node, answer, index, subindex)

    return Request(
        wire.encode_download(
            node.node,
            index,
            subindex,
            data,
            sized=states_length,
            extended=node.dialect.extended(node.node),
        ),
        (wire.download_due(node.node, index, subindex),),
        read,
        lane=node.node,
        priority=priority,
        effect=Effect.TORQUE if index in UNSETTLING else row.effect,
        setpoints=goals,
        repeatable=index != MID_POINT,
        precondition=refusal,
    )


async def order(
    node: Node,
    row: Register,
    raw: int,
    goals: tuple[Setpoint, ...] = (),
    *,
    priority: Priority = Priority.CONTROL,
) -> None:
    """Write a row. Raises DeviceError when the node refuses it, OutcomeUnknown when it never acknowledges."""
    await decided(node)
    data = row.encode(raw)
    states_length = node.dialect.states_length(node.node)
    try:
        await download(node, row, data, states_length=states_length, goals=goals, priority=priority)
    except DeviceError as refusal:
        if states_length or node.dialect.sized != "auto" or meant(refusal.code) not in UNSIZED_REFUSED:
            raise
        await download(node, row, data, states_length=True, goals=goals, priority=priority)
        node.dialect.learn_sized(node.node)


def told(node: Node, answer: Response, index: int, subindex: int) -> SdoReply:
    """What the one reply of an answer says. Raises DeviceError for a refusal."""
    node.at = answer.at
    reply = wire.decode_reply(answer.replies[0].data)
    if reply is None:
        raise UnexpectedReply(
            f"node {node.node} sent what is no reply", received=answer.replies[0].data, node=node.node
        )
    if reply.kind == "abort":
        raise refused(node, reply, index, subindex)
    return reply


def refused(node: Node, reply: SdoReply, index: int, subindex: int) -> DeviceError:
    """The error for an abort, which repeats index and sub-index of the request, or leaves them 0."""
    row = node.table.at(index, subindex)
    name = row.name if row else f"object 0x{index:04X}:{subindex}"
    error = DeviceError(
        f"node {node.node} refused {name}: {abort_text(reply.code)}",
        code=reply.code,
        register=row.name if row else "",
        expected=f"an answer about 0x{index:04X}:{subindex}",
        cause=_cause(node, meant(reply.code)),
        node=node.node,
    )
    if (reply.index, reply.subindex) != (index, subindex):
        error.add_note(
            f"the refusal names 0x{reply.index:04X}:{reply.subindex}; it was taken for the answer, because the "
            f"manual leaves open what it repeats"
        )
    return error


def _cause(node: Node, code: int) -> str:
    if code in ABSENT:
        return f"this servo lacks what the profile {node.profile.name} has: older firmware, or another maker"
    if not code:
        return "no refusal has the code 0: an adapter's text may have made one of an acknowledgement; read it back"
    return ""


def meant(code: int) -> int:
    """The abort code, also when the node sent its bytes the wrong way round."""
    swapped = int.from_bytes(code.to_bytes(4, "little"), "big")
    return swapped if code not in ABORTS and swapped in ABORTS else code


# --- which id format a node answers -------------------------------------------------------------------------


def ready(node: Node, say: Callable[[Node], Runnable[T]]) -> Runnable[T]:
    """What `say` says; preceded, where ids may have two formats, by finding out which one this node answers."""
    return _after(node, say) if node.dialect.undecided(node.node) else say(node)


async def _after(node: Node, say: Callable[[Node], Runnable[T]]) -> T:
    await decided(node)
    return await say(node)


async def decided(node: Node) -> None:
    """Find out, once, which id format this node answers: 11 bits are tried first. Raises NoReply for neither.

    Silence is expected of one of the two, so it must not make the node doubtful.
    """
    if not node.dialect.undecided(node.node):
        return
    for extended in (False, True) * 2:
        frame = wire.encode_upload(node.node, NODE_ID, extended=extended)
        if await listening(node, frame, _somebody, timeout=TimeoutClass.REPLY, priority=Priority.POLL):
            node.dialect.learn_format(node.node, extended)
            return
    raise NoReply(
        f"node {node.node} answers neither 11-bit nor 29-bit identifiers",
        expected=f"an answer to a read of 0x{NODE_ID:04X}",
        cause="no such id on this bus, another bit rate, no power, or a loose cable",
        advice="`motorbus scan BUS` lists who answers",
        node=node.node,
    )


def _somebody(replies: list[SdoReply], at: float) -> bool:
    return any(reply.index in (NODE_ID, 0) for reply in replies)


def answers(node: Node) -> Request[None]:
    """Ask for the node id; a refusal is an answer, silence raises NoReply."""

    def read(answer: Response) -> None:
        node.at = answer.at

    return Request(
        wire.encode_upload(node.node, NODE_ID, extended=node.dialect.extended(node.node)),
        (wire.upload_due(node.node, NODE_ID),),
        read,
        lane=node.node,
        repeatable=True,
    )


# --- values longer than four bytes --------------------------------------------------------------------------


async def whole(node: Node, row: Register) -> bytes:
    """All bytes of a value: four at most in the one reply that KST servos give, else segment by segment.

    A transfer in segments is carried out with the bus to itself, for a second request would end it. Raises
    DeviceError for a refusal, UnexpectedReply for segments out of order or without end.
    """
    await decided(node)
    first = await _begin(node, row)
    if first.kind == "upload":
        return first.data
    return await Exclusive(_segments(node, row))


def _begin(node: Node, row: Register) -> Request[SdoReply]:
    return upload(node, row.address, row.subindex or 0, lambda reply: reply)


async def _segments(node: Node, row: Register) -> bytes:
    first = await _begin(node, row)  # once more, for something else may have come in between
    if first.kind == "upload":
        return first.data
    data, toggle, last = b"", 0, False
    while not last:
        segment = await _segment(node, toggle)
        data += segment.data
        toggle, last = 1 - toggle, segment.last
        if len(data) > LONGEST or not (segment.data or last):
            await _give_up(node, row)
            raise UnexpectedReply(
                f"node {node.node} tells {row.name} and does not end: {len(data)} bytes so far",
                expected=f"{LONGEST} bytes at most, and some in each segment",
                received=data[:32],
                node=node.node,
            )
    if first.size is not None and len(data) != first.size:
        raise UnexpectedReply(
            f"node {node.node} announced {first.size} bytes of {row.name} and sent {len(data)}",
            received=data,
            node=node.node,
        )
    return data


def _segment(node: Node, toggle: int) -> Request[SdoReply]:
    def read(answer: Response) -> SdoReply:
        return told(node, answer, 0, 0)

    return Request(
        wire.encode_segment(node.node, toggle, extended=node.dialect.extended(node.node)),
        (wire.segment_due(node.node, toggle),),
        read,
        lane=node.node,
    )


def _give_up(node: Node, row: Register) -> Request[None]:
    frame = wire.encode_abort(
        node.node, row.address, row.subindex or 0, GIVE_UP, extended=node.dialect.extended(node.node)
    )
    return Request(frame, (), lambda _: None, lane=node.node)


# --- replies that are counted, or may be missing ------------------------------------------------------------


def listening(
    node: Node,
    frame: CanFrame,
    take: Callable[[list[SdoReply], float], T],
    *,
    timeout: TimeoutClass,
    effect: Effect = Effect.NONE,
    priority: Priority = Priority.CONFIGURATION,
) -> Request[T]:
    """Send a frame and take whatever comes from this node until the time is up; silence is an answer too."""

    def read(answer: Response) -> T:
        replies = [wire.decode_reply(reply.data) for reply in answer.replies]
        return take([reply for reply in replies if reply is not None], answer.at)

    return Request(frame, ANY, read, lane=node.node, priority=priority, effect=effect, reply_within=timeout)
