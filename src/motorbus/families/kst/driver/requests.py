"""Requests to one servo: read an object, write one.

A reply is accepted by its index and sub-index, also an acknowledgement. An abort raises DeviceError with the words of
the manual.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register
from motorbus.core.request import (
    Data,
    Effect,
    ExactDecoder,
    Precondition,
    Priority,
    Request,
    Response,
    TimeoutClass,
)
from motorbus.core.setpoint import Setpoint
from motorbus.errors import DeviceError, UnexpectedReply
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.sdo import SdoReply

T = TypeVar("T")

CHANGES_POSITION: Final = frozenset(("mid_point", "negative_limit", "positive_limit", "function_enable"))
"""No source says whether a servo moves to its old target after a write of these. So gate and latch treat such a write
as torque on."""
UNSIZED_REFUSED: Final = frozenset((0x0504_0001, 0x0607_0010, 0x0607_0012, 0x0607_0013))
"""Abort codes that may mean "state the length"."""
SDO_HEAD: Final = 4  # specifier, index and sub-index
ABSENT: Final = frozenset((0x0601_0000, 0x0601_0001, 0x0602_0000, 0x0609_0011))
"""Abort codes of an object that cannot be read."""


def upload(
    node: Node,
    row: Register,
    decode: Callable[[Response], T],
    *,
    priority: Priority = Priority.POLL,
    reply_within: TimeoutClass = TimeoutClass.REPLY,
    reports_position: bool | Callable[[Response], Mapping[int, float]] = False,
    decode_exact: ExactDecoder[T] | None = None,
) -> Request[T]:
    """Read an object; `decode` gets the response, which may be an abort."""
    return Request(
        node.settings.upload(node.node, row),
        (sdo.upload_due(node.node, row.address, row.subindex or 0),),
        decode,
        lane=node.node,
        priority=priority,
        reply_within=reply_within,
        repeatable=True,
        reports_position=reports_position,
        decode_exact=decode_exact,
    )


def read_register(
    node: Node, row: Register, take: Callable[[int], T], *, reports_position: bool = False
) -> Request[T]:
    """Read an object; `take` gets its raw value. Raises DeviceError for an abort, UnexpectedReply for another size."""

    def decode(answer: Response) -> T:
        return take(row.decode(value_bytes(node, row, accepted(node, row, answer))))

    def positions(answer: Response) -> dict[int, float]:
        reply = sdo.decode_reply(answer.replies[0].data)
        if reply is None or reply.kind != "upload" or len(reply.data) < row.size:
            return {}
        return {node.node: float(row.to_value(row.decode(reply.data[: row.size])))}

    reply = node.settings.format(
        sdo.encode_upload_reply(node.node, row.address, row.subindex or 0, bytes(row.size))
    )

    def decode_exact(frame: Data, at: float) -> T | None:
        if type(frame) is not CanFrame or frame.id != reply.id or frame.extended is not reply.extended:
            return None
        if len(frame.data) != sdo.LENGTH or frame.data[:SDO_HEAD] != reply.data[:SDO_HEAD]:
            return None
        node.at = at
        return take(row.decode(frame.data[SDO_HEAD : SDO_HEAD + row.size]))

    return upload(
        node,
        row,
        decode,
        reports_position=reports_position and positions,
        decode_exact=decode_exact if reports_position else None,
    )


def value_bytes(node: Node, row: Register, reply: SdoReply) -> bytes:
    """The bytes of this object in a reply. Raises UnexpectedReply for another size, save for an extended sign."""
    own, more = reply.data[: row.size], reply.data[row.size :]
    extended = more in (bytes(len(more)), b"\xff" * len(more) if own[-1:] > b"\x7f" else b"")
    if reply.kind == "upload" and len(own) == row.size and (reply.size is None or extended):
        return own
    length = "segments" if reply.kind == "upload-start" else f"{reply.size} bytes"
    raise UnexpectedReply(
        f"node {node.node} sends {row.name} in {length}, not in {row.size} bytes",
        received=reply.data,
        cause=f"its maker is not that of the profile {node.profile.name}, as in kst:PORT,profile=kst-ext",
        node=node.node,
    )


def ask_presence(node: Node) -> Request[None]:
    """Read the node id; an abort counts as a reply. Silence raises NoReply."""

    def decode(answer: Response) -> None:
        node.at = answer.at

    return upload(node, node.table["node_id"], decode)


def write_register(
    node: Node,
    row: Register,
    raw: int,
    setpoints: tuple[Setpoint, ...] = (),
    *,
    priority: Priority = Priority.CONTROL,
    precondition: Precondition | None = None,
) -> Request[None]:
    """Write an object. Raises RequestError outside its range, DeviceError for an abort, OutcomeUnknown without a reply.

    A mid point is not repeated: the servo may have moved by then.
    """

    def decode(answer: Response) -> None:
        accepted(node, row, answer)

    return Request(
        node.settings.download(node.node, row, raw),
        (sdo.download_due(node.node, row.address, row.subindex or 0),),
        decode,
        lane=node.node,
        priority=priority,
        effect=Effect.TORQUE if row.name in CHANGES_POSITION else row.effect,
        setpoints=setpoints,
        repeatable=row.name != "mid_point",
        precondition=precondition,
    )


def accepted(node: Node, row: Register, answer: Response) -> SdoReply:
    """The decoded reply. Raises DeviceError for an abort."""
    node.at = answer.at
    reply = sdo.decode_reply(answer.replies[0].data)
    assert reply is not None  # a receiver makes no reply of an invalid frame
    if reply.kind == "abort":
        raise refused(node, row, reply)
    return reply


def acknowledged(node: Node, row: Register) -> Callable[[Response], Response]:
    """A decoder that gives the response itself. It raises DeviceError for an abort."""

    def decode(answer: Response) -> Response:
        accepted(node, row, answer)
        return answer

    return decode


def decoded(answer: Response) -> list[SdoReply]:
    """All replies of a response."""
    replies = [sdo.decode_reply(reply.data) for reply in answer.replies]
    return [reply for reply in replies if reply is not None]


def refused(node: Node, row: Register, reply: SdoReply) -> DeviceError:
    """The error for an abort of a request for this object."""
    code, advice = sdo.meant_code(reply.code), ""
    if code in ABSENT:
        advice = (
            f"choose another profile than {node.profile.name}: older firmware or another maker lacks this"
        )
    elif code in UNSIZED_REFUSED and not node.settings.sized:
        advice = "let writes state their length, as in kst:PORT,sized=yes"
    return DeviceError(
        f"node {node.node} refused {row.name}: {sdo.abort_text(reply.code)}",
        code=reply.code,
        register=row.name,
        advice=advice,
        node=node.node,
    )


def is_absent(error: object) -> bool:
    """Whether this error says that the servo lacks the object."""
    return isinstance(error, DeviceError) and sdo.meant_code(error.code) in ABSENT
