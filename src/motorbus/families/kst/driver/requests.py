"""Requests to one servo: read an object, write one, save.

A reply is accepted by its index and sub-index, also an acknowledgement. An abort raises DeviceError with the words of
the manual.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register
from motorbus.core.request import ANY, Data, Effect, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.errors import DeviceError, UnexpectedReply
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.profiles import SAVE
from motorbus.families.kst.sdo import Sdo

T = TypeVar("T")

CHANGES_POSITION: Final = frozenset(("mid_point", "negative_limit", "positive_limit", "function_enable"))
"""No source says whether a servo moves to its old target after a write of these. So gate and latch treat such a write
as torque on."""
UNSIZED_REFUSED: Final = frozenset((0x0504_0001, 0x0607_0010, 0x0607_0012, 0x0607_0013))
"""Abort codes that may mean "state the length"."""
ABSENT: Final = frozenset((0x0601_0000, 0x0601_0001, 0x0602_0000, 0x0609_0011))
"""Abort codes of an object that cannot be read."""


def upload(node: Node, row: Register, decode: Callable[[Response], T], **options: Any) -> Request[T]:
    """Read an object; `decode` gets the response, which may be an abort."""
    due = sdo.expected(node.node, "upload", row.address, row.subindex or 0)
    frame = node.settings.upload(node.node, row)
    return Request(frame, (due,), decode, lane=node.node, repeatable=True, **options)


def read_row(node: Node, row: Register, take: Callable[[int], T]) -> Request[T]:
    """Read an object; `take` gets its raw value. Raises DeviceError for an abort, UnexpectedReply for another size."""
    return upload(
        node, row, lambda answer: take(row.decode(value_bytes(node, row, accepted(node, row, answer))))
    )


def read_position(node: Node, take: Callable[[int], T], **options: Any) -> Request[T]:
    """Read the present position as `read_row`; the bus learns it, and decodes a reply of the usual form at once."""
    row = node.table["present_position"]
    head = sdo.encode_upload_reply(node.node, row.address, 0, bytes(row.size)).data[:4]
    identifier, extended = sdo.REPLY + node.node, node.settings.extended

    def positions(answer: Response) -> dict[int, float]:
        raw = position_in(row, answer)
        return {} if raw is None else {node.node: float(row.to_value(raw))}

    def decode_exact(frame: Data, at: float) -> T | None:
        if type(frame) is not CanFrame or frame.id != identifier or frame.extended is not extended:
            return None
        data = frame.data
        if len(data) != sdo.LENGTH or data[:4] != head:
            return None
        node.at = at
        return take(row.decode(data[4 : 4 + row.size]))

    decode = read_row(node, row, take).decode
    assert decode is not None
    return upload(node, row, decode, reports_position=positions, decode_exact=decode_exact, **options)


def position_in(row: Register, answer: Response | None) -> int | None:
    """The raw position in the replies to a read of it, or None."""
    for reply in decoded(answer) if answer else ():
        if reply.kind == "upload" and reply.index == row.address and len(reply.data) >= row.size:
            return row.decode(reply.data[: row.size])
    return None


def ask_presence(node: Node) -> Request[None]:
    """Read the node id; an abort counts as a reply. Silence raises NoReply."""

    def decode(answer: Response) -> None:
        node.at = answer.at

    return upload(node, node.table["node_id"], decode)


def write_row(
    node: Node,
    row: Register,
    raw: int,
    setpoints: tuple[Setpoint, ...] = (),
    priority: Priority = Priority.CONTROL,
    **options: Any,
) -> Request[None]:
    """Write an object. Raises RequestError outside its range, DeviceError for an abort, OutcomeUnknown without a reply.

    A mid point is not repeated: the servo may have moved by then.
    """

    def decode(answer: Response) -> None:
        accepted(node, row, answer)

    return Request(
        node.settings.download(node.node, row, raw),
        (sdo.expected(node.node, "download", row.address, row.subindex or 0),),
        decode,
        lane=node.node,
        priority=priority,
        effect=effect_of(row),
        setpoints=setpoints,
        repeatable=row.name != "mid_point",
        **options,
    )


def effect_of(row: Register) -> Effect:
    """The effect of a write of this object."""
    return Effect.TORQUE if row.name in CHANGES_POSITION else row.effect


def save(node: Node) -> Request[None]:
    """Store node id, bit rate, travel limits and function bits; never the target position.

    The request holds the lane of the node until flash is written. No reply is expected; an abort raises DeviceError.
    """
    row = node.table["store"]

    def decode(answer: Response) -> None:
        node.at = answer.at
        for reply in decoded(answer):
            if reply.kind == "abort" and reply.index in (row.address, 0):
                raise refused(node, row, reply)

    return Request(
        node.settings.download(node.node, row, SAVE),
        ANY,
        decode,
        lane=node.node,
        priority=Priority.CONFIGURATION,
        effect=row.effect,
        reply_within=TimeoutClass.STORE,
    )


# -- replies ---------------------------------------------------------------------------------------------------


def decoded(answer: Response) -> list[Sdo]:
    """All replies of a response."""
    replies = [sdo.decode_reply(reply.data) for reply in answer.replies]
    return [reply for reply in replies if reply is not None]


def accepted(node: Node, row: Register, answer: Response) -> Sdo:
    """The decoded reply. Raises DeviceError for an abort."""
    node.at = answer.at
    (reply,) = decoded(answer)
    if reply.kind == "abort":
        raise refused(node, row, reply)
    return reply


def value_bytes(node: Node, row: Register, reply: Sdo) -> bytes:
    """The bytes of this object in a reply. Raises UnexpectedReply for another size, save for an extended sign."""
    own, more = reply.data[: row.size], reply.data[row.size :]
    extended = more in (bytes(len(more)), b"\xff" * len(more) if own[-1:] > b"\x7f" else b"")
    if reply.kind == "upload" and len(own) == row.size and (reply.size is None or extended):
        return own
    length = "segments" if reply.kind == "segments" else f"{reply.size} bytes"
    raise UnexpectedReply(
        f"node {node.node} sends {row.name} in {length}, not in {row.size} bytes",
        received=reply.data,
        cause=f"its maker is not that of the profile {node.profile.name}, as in kst:PORT,profile=kst-ext",
        node=node.node,
    )


def refused(node: Node, row: Register, reply: Sdo) -> DeviceError:
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
