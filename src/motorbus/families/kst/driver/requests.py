"""Requests to one servo: read an object, write one, read a value in segments, collect replies.

A reply is accepted by its index and sub-index, also an acknowledgement. An abort raises DeviceError with the words of
the manual.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register
from motorbus.core.request import ANY, Effect, Precondition, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive
from motorbus.errors import DeviceError, UnexpectedReply
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.sdo import SdoReply

T = TypeVar("T")

NODE_ID: Final = 0x3000
POSITION: Final = 0x6002
GOAL: Final = 0x6003
STORE: Final = 0x1010
FIRMWARE: Final = 0x100A
MID_POINT: Final = 0x3009
CHANGES_POSITION: Final = frozenset((MID_POINT, 0x300A, 0x300B, 0x300F))
"""Mid point, travel limits and function bits: no source says whether a servo then moves to its old target. So gate and
latch treat such a write as torque on."""
UNSIZED_REFUSED: Final = frozenset((0x0504_0001, 0x0607_0010, 0x0607_0012, 0x0607_0013))
"""Abort codes that may mean "state the length"."""
ABSENT: Final = frozenset((0x0601_0000, 0x0601_0001, 0x0602_0000, 0x0609_0011))
"""Abort codes of an object that cannot be read."""
LONGEST: Final = 256
"""Maximum bytes of a value in segments; a version has a few dozen."""
GENERAL_ERROR: Final = 0x0800_0000


class OtherSize(UnexpectedReply):
    """An object has another size than its row."""


# -- read ------------------------------------------------------------------------------------------------------


def read_object(
    node: Node,
    index: int,
    subindex: int,
    take: Callable[[SdoReply], T],
    *,
    priority: Priority = Priority.POLL,
) -> Request[T]:
    """Read an object; `take` makes the value of its reply. An abort raises DeviceError."""

    def decode(answer: Response) -> T:
        return take(accepted(node, answer, index, subindex))

    return _upload(node, index, subindex, decode, priority=priority)


def read_register(
    node: Node, row: Register, take: Callable[[int], T], *, reports_position: bool = False
) -> Request[T]:
    """Read a row; `take` makes the value of its raw value.

    Raises DeviceError for an abort, OtherSize for a reply of another size.
    """
    index, subindex = row.address, row.subindex or 0
    head, end = sdo.upload_head(index, subindex, row.size), 4 + row.size

    def decode(answer: Response) -> T:
        data = answer.replies[0].data
        if data[:4] == head and len(data) == sdo.LENGTH:  # the common form, without decoding the specifier
            node.at = answer.at
            return take(row.decode(data[4:end]))
        return take(row.decode(value_bytes(node, row, accepted(node, answer, index, subindex))))

    def positions(answer: Response) -> dict[int, float]:
        reply = sdo.decode_reply(answer.replies[0].data)
        if reply is None or reply.kind != "upload":
            return {}
        return {node.node: float(row.to_value(row.decode(reply.data[: row.size])))}

    return _upload(node, index, subindex, decode, reports_position=reports_position and positions)


def _upload(
    node: Node,
    index: int,
    subindex: int,
    decode: Callable[[Response], T],
    *,
    priority: Priority = Priority.POLL,
    reports_position: bool | Callable[[Response], Mapping[int, float]] = False,
) -> Request[T]:
    return Request(
        sdo.encode_upload(node.node, index, subindex, extended=node.settings.extended),
        (sdo.upload_due(node.node, index, subindex),),
        decode,
        lane=node.node,
        priority=priority,
        repeatable=True,
        reports_position=reports_position,
    )


def value_bytes(node: Node, row: Register, reply: SdoReply) -> bytes:
    """The bytes of this row in a reply. Raises OtherSize for fewer bytes, segments, or a longer value.

    More bytes than the row has are accepted where the reply states no length, and where they only extend the value by
    zeros or its sign.
    """
    own, more = reply.data[: row.size], reply.data[row.size :]
    filled = reply.size is None or more.strip(b"\0") == b"" or (own[-1] > 0x7F and more.strip(b"\xff") == b"")
    if reply.kind == "upload" and len(own) == row.size and filled:
        return own
    came = f"{reply.size} bytes in segments" if reply.kind == "upload-start" else f"{len(reply.data)} bytes"
    raise OtherSize(
        f"node {node.node} sends {row.name} in {came}, not in {row.size}",
        received=reply.data,
        expected=f"{row.size} bytes",
        cause=f"its firmware is not of the profile {node.profile.name}",
        advice="choose the profile of its maker, as in kst:PORT,profile=kst-ext",
        node=node.node,
    )


def ask_presence(node: Node) -> Request[None]:
    """Read the node id; an abort counts as a reply. Silence raises NoReply."""

    def decode(answer: Response) -> None:
        node.at = answer.at

    return _upload(node, NODE_ID, 0, decode)


# -- write -----------------------------------------------------------------------------------------------------


def write_register(
    node: Node,
    row: Register,
    raw: int,
    setpoints: tuple[Setpoint, ...] = (),
    *,
    priority: Priority = Priority.CONTROL,
    precondition: Precondition | None = None,
) -> Request[None]:
    """Write a row. Raises RequestError outside its range, DeviceError for an abort, OutcomeUnknown without a reply.

    The acknowledgement proves receipt only. A mid point is not repeated: the servo may have moved by then.
    """
    index, subindex = row.address, row.subindex or 0

    def decode(answer: Response) -> None:
        accepted(node, answer, index, subindex)

    return Request(
        sdo.encode_download(
            node.node,
            index,
            subindex,
            row.encode(raw),
            sized=node.settings.sized,
            extended=node.settings.extended,
        ),
        (sdo.download_due(node.node, index, subindex),),
        decode,
        lane=node.node,
        priority=priority,
        effect=Effect.TORQUE if index in CHANGES_POSITION else row.effect,
        setpoints=setpoints,
        repeatable=index != MID_POINT,
        precondition=precondition,
    )


# -- replies ---------------------------------------------------------------------------------------------------


def accepted(node: Node, answer: Response, index: int, subindex: int) -> SdoReply:
    """The decoded reply. Raises DeviceError for an abort."""
    node.at = answer.at
    reply = sdo.decode_reply(answer.replies[0].data)
    if reply is None:
        raise UnexpectedReply(
            f"node {node.node} sent an invalid reply", received=answer.replies[0].data, node=node.node
        )
    if reply.kind == "abort":
        raise refused(node, reply, index, subindex)
    return reply


def refused(node: Node, reply: SdoReply, index: int, subindex: int) -> DeviceError:
    """The error for an abort of a request for this object."""
    row = node.table.at(index, subindex)
    name = row.name if row else f"object 0x{index:04X}:{subindex}"
    code = sdo.meant_code(reply.code)
    cause = advice = ""
    if code in ABSENT:
        cause = f"this servo lacks what the profile {node.profile.name} has: older firmware, or another maker"
    elif not code:
        cause = "no abort has the code 0: the text of an adapter may have changed an acknowledgement; read it back"
    elif code in UNSIZED_REFUSED and not node.settings.sized:
        cause = "some servos accept only writes that state their length"
        advice = "open the bus with sized=yes, as in kst:PORT,sized=yes"
    error = DeviceError(
        f"node {node.node} refused {name}: {sdo.abort_text(reply.code)}",
        code=reply.code,
        register=row.name if row else "",
        expected=f"an answer about 0x{index:04X}:{subindex}",
        cause=cause,
        advice=advice,
        node=node.node,
    )
    if (reply.index, reply.subindex) != (index, subindex):
        error.add_note(
            f"the refusal names 0x{reply.index:04X}:{reply.subindex}; the manual leaves open what a refusal repeats"
        )
    return error


def is_absent(error: object) -> bool:
    """Whether this error says that the servo lacks the object."""
    return isinstance(error, DeviceError) and sdo.meant_code(error.code) in ABSENT


def collect(
    node: Node,
    frame: CanFrame,
    take: Callable[[list[SdoReply], float], T],
    *,
    reply_within: TimeoutClass = TimeoutClass.REPLY,
    effect: Effect = Effect.NONE,
    priority: Priority = Priority.POLL,
) -> Request[T]:
    """Send a frame and collect all replies of this node before the deadline, also none."""

    def decode(answer: Response) -> T:
        replies = [sdo.decode_reply(reply.data) for reply in answer.replies]
        return take([reply for reply in replies if reply is not None], answer.at)

    return Request(
        frame, ANY, decode, lane=node.node, priority=priority, effect=effect, reply_within=reply_within
    )


# -- values of more than four bytes ----------------------------------------------------------------------------


async def read_all_bytes(node: Node, row: Register) -> bytes:
    """All bytes of a value: from one reply, or segment by segment with the bus reserved.

    Raises DeviceError for an abort, UnexpectedReply for invalid segments.
    """
    first = await _start_upload(node, row)
    return first.data if first.kind == "upload" else await Exclusive(_read_segments(node, row))


def _start_upload(node: Node, row: Register) -> Request[SdoReply]:
    return read_object(node, row.address, row.subindex or 0, lambda reply: reply)


async def _read_segments(node: Node, row: Register) -> bytes:
    first = await _start_upload(node, row)  # again: another request may have ended the transfer
    if first.kind == "upload":
        return first.data
    data, toggle, last = b"", 0, False
    while not last:
        segment = await Request(
            sdo.encode_segment(node.node, toggle, extended=node.settings.extended),
            (sdo.segment_due(node.node, toggle),),
            lambda answer: accepted(node, answer, 0, 0),
            lane=node.node,
        )
        data += segment.data
        toggle, last = 1 - toggle, segment.last
        if len(data) > LONGEST or not (segment.data or last):
            subindex, extended = row.subindex or 0, node.settings.extended
            frame = sdo.encode_abort(node.node, row.address, subindex, GENERAL_ERROR, extended=extended)
            await Request(frame, (), lane=node.node)
            raise UnexpectedReply(
                f"node {node.node} does not end {row.name}: {len(data)} bytes so far",
                expected=f"at most {LONGEST} bytes, and some in each segment",
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
