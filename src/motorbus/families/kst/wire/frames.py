"""The frames a client sends, and the last gate before the wire.

A node, index, sub-index or length that no frame can carry raises RequestError here and is never sent. What an object
accepts is said by its row, and checked where rows are known.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError

REQUEST: Final = 0x600
"""A request has this identifier plus the node's number."""
REPLY: Final = 0x580
"""A reply has this identifier plus the node's number."""
EVERYONE: Final = 0
NODES: Final = range(1, 128)
LENGTH: Final = 8
"""Data bytes of every request and reply."""
EXPEDITED: Final = 4
"""Most data bytes that one request or reply carries."""

UPLOAD: Final = 0x40
DOWNLOAD_UNSIZED: Final = 0x22
DOWNLOAD_SIZED: Final = {1: 0x2F, 2: 0x2B, 3: 0x27, 4: 0x23}
SEGMENT: Final = 0x60
ABORT: Final = 0x80
TOGGLE: Final = 0x10


class Multiplexer(NamedTuple):
    """Which object: index 0 to 0xFFFF, sub-index 0 to 0xFF."""

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody needs here
    subindex: int = 0


def encode_upload(node: int, index: int, subindex: int = 0, *, extended: bool = False) -> CanFrame:
    """Read an object of one node, 1 to 127, or of everyone, 0: `40 il ih sub 00 00 00 00`.

    `extended` sends the same identifier in 29 bits. Raises RequestError for an impossible node or object.
    Source: KST CAN protocol manual, commands 4, 6, 7 and 8; data bytes of a read are 0 (CiA 301: reserved).
    """
    head = bytes((UPLOAD,)) + multiplexer(index, subindex)
    return CanFrame(_request(node), head.ljust(LENGTH, b"\0"), extended)


def encode_download(
    node: int, index: int, subindex: int, data: bytes, *, sized: bool = False, extended: bool = False
) -> CanFrame:
    """Write 1 to 4 bytes to an object of one node, 1 to 127, or of everyone, 0.

    As the manual has it the specifier is 0x22 and does not state the length; `sized` states it (0x2F, 0x2B, 0x27, 0x23
    for 1 to 4 bytes). Raises RequestError for an impossible node, object or length.
    Source: KST CAN protocol manual, commands 1, 2, 3 and 5; CiA 301 for the sized form.
    """
    size = _expedited(data)
    specifier = DOWNLOAD_SIZED[size] if sized else DOWNLOAD_UNSIZED
    head = bytes((specifier,)) + multiplexer(index, subindex)
    return CanFrame(_request(node), (head + data).ljust(LENGTH, b"\0"), extended)


def encode_segment(node: int, toggle: int, *, extended: bool = False) -> CanFrame:
    """Ask for the next segment of an upload; `toggle` is 0 for the first, then alternates.

    Raises RequestError for an impossible node or toggle. Source: CiA 301, segmented upload.
    """
    return CanFrame(
        REQUEST + one(node), bytes((SEGMENT | toggle_bit(toggle),)).ljust(LENGTH, b"\0"), extended
    )


def encode_abort(node: int, index: int, subindex: int, code: int, *, extended: bool = False) -> CanFrame:
    """Give a transfer up, as the client. Nobody answers that. Raises RequestError for an impossible field.

    Source: CiA 301, abort SDO transfer.
    """
    return CanFrame(REQUEST + one(node), abort_data(index, subindex, code), extended)


# --- fields, shared with the server's side ------------------------------------------------------------------


def multiplexer(index: int, subindex: int) -> bytes:
    """Bytes 1 to 3 of a frame. Raises RequestError when they cannot name an object."""
    if not (0 <= index <= 0xFFFF and 0 <= subindex <= 0xFF):
        raise RequestError(
            f"object 0x{index:X}:{subindex} is impossible",
            expected="an index of 0 to 0xFFFF and a sub-index of 0 to 255",
            advice="nothing was sent",
        )
    return bytes((index & 0xFF, index >> 8, subindex))


def abort_data(index: int, subindex: int, code: int) -> bytes:
    """The data of an abort, either direction. Raises RequestError when the code does not fit 32 bits."""
    if not 0 <= code <= 0xFFFF_FFFF:
        raise RequestError(
            f"abort code {code} does not fit 32 bits", expected="0 to 0xFFFFFFFF", advice="nothing was sent"
        )
    return bytes((ABORT,)) + multiplexer(index, subindex) + code.to_bytes(4, "little")


def toggle_bit(toggle: int) -> int:
    """Bit 4 of the specifier of a segment. Raises RequestError unless it is 0 or 1."""
    if toggle not in (0, 1):
        raise RequestError(f"toggle {toggle} is impossible", expected="0 or 1", advice="nothing was sent")
    return TOGGLE if toggle else 0


def one(node: int) -> int:
    """This node, if it is one. Raises RequestError for anything but 1 to 127."""
    if node not in NODES:
        raise RequestError(
            f"{node} is not a node id",
            expected="1 to 127",
            advice="nothing was sent",
            node=node,
        )
    return node


def _request(node: int) -> int:
    """The identifier of a request to this node or to everyone."""
    if node != EVERYONE and node not in NODES:
        raise RequestError(
            f"{node} is not a node id",
            expected="1 to 127, or 0 for everyone",
            advice="nothing was sent",
            node=node,
        )
    return REQUEST + node


def _expedited(data: bytes) -> int:
    """How many bytes these are. Raises RequestError unless one frame carries them."""
    if not 1 <= len(data) <= EXPEDITED:
        raise RequestError(
            f"{len(data)} bytes cannot be written in one frame",
            expected=f"1 to {EXPEDITED} bytes",
            advice="nothing was sent",
        )
    return len(data)
