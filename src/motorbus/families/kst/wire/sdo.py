"""Requests and replies taken apart, and the replies a server makes.

Specifier, byte 0: bits 7 to 5 say what it is; in a transfer of an object bit 1 (e) says that the data are in this very
frame, bit 0 (s) that their length is stated, bits 3 and 2 (n) how many of the four bytes carry nothing. Reserved bits
are ignored, as CiA 301 wants; only 0x60 and 0x80, which have no fields, are compared whole.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError
from motorbus.families.kst.wire.frames import (
    ABORT,
    EVERYONE,
    EXPEDITED,
    LENGTH,
    NODES,
    REPLY,
    REQUEST,
    TOGGLE,
    abort_data,
    multiplexer,
    one,
    toggle_bit,
)

SPECIFIER: Final = 0xE0
"""The bits of byte 0 that say what a frame is."""
DOWNLOADED: Final = 0x60
"""Byte 0 of a reply: written."""
_E: Final = 2
_S: Final = 1
_SEGMENT_BYTES: Final = 7


class SdoRequest(NamedTuple):
    """What a client asked.

    `node` is 0 for everyone; `kind` is "upload", "download", "segment", "abort" or "unknown"; `data` are the bytes
    that count: for a download that does not state its length (`sized` false) all four, of which the object takes
    its own size; for an abort the code; none for an upload or a segment; bytes 4 to 7 of what is unknown.
    """

    node: int
    kind: str
    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody needs here
    subindex: int
    data: bytes
    sized: bool
    toggle: int
    extended: bool


class SdoReply(NamedTuple):
    """What a server said.

    `kind` is "upload" (with `data`), "upload-start" (segments follow), "segment" (with `data`), "download" or
    "abort" (with `code`). `size` is the length the reply states: of `data`, or of the whole at an upload-start; None
    where it states none (`data` are then all four bytes, of which the object takes its own size). `index` and
    `subindex` are 0 in a segment, `toggle` and `last` 0 and False in everything else.
    """

    kind: str
    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody needs here
    subindex: int
    data: bytes = b""
    code: int = 0
    size: int | None = None
    toggle: int = 0
    last: bool = False


def decode_request(frame: CanFrame) -> SdoRequest | None:
    """For a server: a request in either id format, or None for every other frame.

    None too for a request that has not exactly 8 bytes (CiA 301) and for remote and error frames.
    """
    node, data = frame.id - REQUEST, frame.data
    if len(data) != LENGTH or (node != EVERYONE and node not in NODES):
        return None
    index, subindex, rest = data[1] | data[2] << 8, data[3], data[4:]
    specifier, kind = data[0], _request_kind(data[0])
    if kind == "segment":
        return SdoRequest(node, kind, 0, 0, b"", False, int(bool(specifier & TOGGLE)), frame.extended)
    sized = kind == "download" and bool(specifier & _S)
    if kind == "upload":
        rest = b""
    elif sized:
        rest = rest[: _stated(specifier)]
    return SdoRequest(node, kind, index, subindex, rest, sized, 0, frame.extended)


def _request_kind(specifier: int) -> str:
    what = specifier & SPECIFIER
    if what == 0x20 and specifier & _E:
        return "download"
    if what == 0x40:
        return "upload"
    if what == 0x60:
        return "segment"
    return "abort" if specifier == ABORT else "unknown"


def _stated(specifier: int) -> int:
    """How many of the four data bytes count, where that is stated."""
    return EXPEDITED - (specifier >> 2 & 3)


def reply_kind(specifier: int) -> str:
    """What a reply with this byte 0 is: a kind of `SdoReply`, or "" for none."""
    what = specifier & SPECIFIER
    if what == 0x40:
        return "upload" if specifier & _E else "upload-start"
    if specifier == DOWNLOADED:
        return "download"
    if specifier == ABORT:
        return "abort"
    return "" if what else "segment"


def usual_head(index: int, subindex: int, size: int) -> bytes:
    """The first four bytes of an upload of so many bytes that states its length, and has no reserved bit set.

    That is how a value comes that is not refused. None of a size that one reply does not carry comes so: b"".
    """
    if not 1 <= size <= EXPEDITED:
        return b""
    specifier = 0x40 | (EXPEDITED - size) << 2 | _E | _S
    return bytes((specifier,)) + multiplexer(index, subindex)


def decode_reply(data: bytes) -> SdoReply | None:
    """The data of a reply taken apart; None when they are not 8 bytes or the specifier is no reply's."""
    kind = reply_kind(data[0]) if len(data) == LENGTH else ""
    if not kind:
        return None
    specifier = data[0]
    if kind == "segment":
        count = _SEGMENT_BYTES - (specifier >> 1 & 7)
        toggle = int(bool(specifier & TOGGLE))
        return SdoReply(kind, 0, 0, data[1 : 1 + count], size=count, toggle=toggle, last=bool(specifier & 1))
    index, subindex, rest = data[1] | data[2] << 8, data[3], data[4:]
    if kind == "upload":
        size = _stated(specifier) if specifier & _S else None
        return SdoReply(kind, index, subindex, rest[:size], size=size)
    if kind == "upload-start":
        stated = int.from_bytes(rest, "little") if specifier & _S else None
        return SdoReply(kind, index, subindex, size=stated)
    if kind == "abort":
        return SdoReply(kind, index, subindex, code=int.from_bytes(rest, "little"))
    return SdoReply(kind, index, subindex)


# --- what a server says -------------------------------------------------------------------------------------


def encode_upload_reply(
    node: int, index: int, subindex: int, data: bytes, *, extended: bool = False
) -> CanFrame:
    """The value of an object, 1 to 4 bytes: specifier 4F, 4B, 47, 43. Raises RequestError for impossible fields."""
    if not 1 <= len(data) <= EXPEDITED:
        raise RequestError(
            f"{len(data)} bytes do not fit one reply", expected="1 to 4 bytes", advice="send segments"
        )
    return _reply(node, usual_head(index, subindex, len(data)) + data, extended)


def encode_upload_start(
    node: int, index: int, subindex: int, size: int | None, *, extended: bool = False
) -> CanFrame:
    """Segments follow, `size` bytes in all: specifier 41; 40 when the size (None) is not stated."""
    if size is not None and not 0 <= size <= 0xFFFF_FFFF:
        raise RequestError(f"{size} bytes cannot be announced", expected="0 to 0xFFFFFFFF bytes")
    specifier, stated = (0x40, b"") if size is None else (0x40 | _S, size.to_bytes(4, "little"))
    return _reply(node, bytes((specifier,)) + multiplexer(index, subindex) + stated, extended)


def encode_segment_reply(
    node: int, toggle: int, data: bytes, last: bool, *, extended: bool = False
) -> CanFrame:
    """One segment of at most 7 bytes, with the toggle of its request. Raises RequestError for impossible fields."""
    if len(data) > _SEGMENT_BYTES:
        raise RequestError(f"{len(data)} bytes do not fit a segment", expected="0 to 7 bytes")
    specifier = toggle_bit(toggle) | (_SEGMENT_BYTES - len(data)) << 1 | int(last)
    return _reply(node, bytes((specifier,)) + data, extended)


def encode_download_reply(node: int, index: int, subindex: int, *, extended: bool = False) -> CanFrame:
    """Written: `60 il ih sub 00 00 00 00`. Raises RequestError for an impossible node or object."""
    return _reply(node, bytes((DOWNLOADED,)) + multiplexer(index, subindex), extended)


def encode_abort_reply(
    node: int, index: int, subindex: int, code: int, *, extended: bool = False
) -> CanFrame:
    """Refused: `80 il ih sub` and the code. Raises RequestError for impossible fields.

    Source: KST CAN protocol manual, command 9.
    """
    return _reply(node, abort_data(index, subindex, code), extended)


def _reply(node: int, data: bytes, extended: bool) -> CanFrame:
    return CanFrame(REPLY + one(node), data.ljust(LENGTH, b"\0"), extended)
