"""SDO frames of KST CAN servos: requests, replies, abort codes, and the keys that match them.

    request   0x600 + node   8 bytes: specifier, index (2), sub-index, data (4), little-endian; node 0: all nodes
    reply     0x580 + node   8 bytes of the same form; an abort carries a code

Byte 0, the specifier: bits 7 to 5 are the kind. In an upload or download bit 1 (e) says that the data are in this
frame, bit 0 (s) that their length is stated, bits 3 and 2 (n) how many of the four data bytes are unused. Reserved
bits are ignored (CiA 301); 0x60 and 0x80, which have no fields, are compared as a whole.

Source: KST CAN protocol manual, commands 1 to 9; CiA 301 for the specifier and for transfers in segments. Frames from a
device never raise an error here; arguments that no frame can carry raise RequestError.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Expected
from motorbus.errors import RequestError

REQUEST: Final = 0x600
"""Identifier of a request, plus the node."""
REPLY: Final = 0x580
"""Identifier of a reply, plus the node."""
BROADCAST: Final = 0
NODES: Final = range(1, 128)
LENGTH: Final = 8
"""Data bytes of each request and reply."""
EXPEDITED: Final = 4
"""Maximum number of value bytes in one frame."""
SEGMENT_BYTES: Final = 7

UPLOAD: Final = 0x40
DOWNLOAD_UNSIZED: Final = 0x22
DOWNLOAD_SIZED: Final = {1: 0x2F, 2: 0x2B, 3: 0x27, 4: 0x23}
DOWNLOADED: Final = 0x60
SEGMENT: Final = 0x60
ABORT: Final = 0x80
TOGGLE: Final = 0x10
_KIND: Final = 0xE0
_E: Final = 2
_S: Final = 1


class SdoRequest(NamedTuple):
    """A decoded request.

    `node` is 0 for all; `kind` is "upload", "download", "segment", "abort" or "unknown". `data` are the value bytes:
    of a download that does not state its length (`sized` false) all four, of an abort its code, of an unknown kind
    bytes 4 to 7; empty for an upload or a segment.
    """

    node: int
    kind: str
    index: int  # type: ignore[assignment]  # hides tuple.index
    subindex: int
    data: bytes
    sized: bool
    toggle: int
    extended: bool


class SdoReply(NamedTuple):
    """A decoded reply.

    `kind` is "upload" (with `data`), "upload-start" (segments follow), "segment" (with `data`), "download" or "abort"
    (with `code`). `size` is the length that the reply states: of `data`, or of the whole value at an upload-start;
    None where it states none, and `data` are then all four bytes. `index` and `subindex` are 0 in a segment, `toggle`
    and `last` 0 and False in all other kinds.
    """

    kind: str
    index: int  # type: ignore[assignment]  # hides tuple.index
    subindex: int
    data: bytes = b""
    code: int = 0
    size: int | None = None
    toggle: int = 0
    last: bool = False


# -- requests --------------------------------------------------------------------------------------------------


def encode_upload(node: int, index: int, subindex: int = 0, *, extended: bool = False) -> CanFrame:
    """Read an object of one node or of all (0): `40 il ih sub 00 00 00 00`. `extended`: 29-bit identifier."""
    return _frame(REQUEST, _addressee(node), bytes((UPLOAD,)) + _object(index, subindex), extended)


def encode_download(
    node: int, index: int, subindex: int, data: bytes, *, sized: bool = False, extended: bool = False
) -> CanFrame:
    """Write 1 to 4 bytes to an object of one node or of all (0).

    The manual uses specifier 0x22, which does not state the length; `sized` states it as CiA 301 does.
    """
    if not 1 <= len(data) <= EXPEDITED:
        raise _impossible(f"{len(data)} bytes cannot be written in one frame", "1 to 4 bytes")
    specifier = DOWNLOAD_SIZED[len(data)] if sized else DOWNLOAD_UNSIZED
    return _frame(REQUEST, _addressee(node), bytes((specifier,)) + _object(index, subindex) + data, extended)


def encode_segment(node: int, toggle: int, *, extended: bool = False) -> CanFrame:
    """Request the next segment of an upload; `toggle` is 0 for the first segment, then alternates."""
    return _frame(REQUEST, _one(node), bytes((SEGMENT | _toggle_bit(toggle),)), extended)


def encode_abort(node: int, index: int, subindex: int, code: int, *, extended: bool = False) -> CanFrame:
    """Abort a transfer as the client; it has no reply."""
    return _frame(REQUEST, _one(node), _abort(index, subindex, code), extended)


def decode_request(frame: CanFrame) -> SdoRequest | None:
    """A request with either identifier format; None for any other frame, also for a request without 8 bytes."""
    node, data = frame.id - REQUEST, frame.data
    if len(data) != LENGTH or (node != BROADCAST and node not in NODES):
        return None
    specifier, index, subindex, rest = data[0], data[1] | data[2] << 8, data[3], data[4:]
    match specifier & _KIND:
        case 0x40:
            return SdoRequest(node, "upload", index, subindex, b"", False, 0, frame.extended)
        case 0x20 if specifier & _E:
            sized = bool(specifier & _S)
            value = rest[: _size(specifier)] if sized else rest
            return SdoRequest(node, "download", index, subindex, value, sized, 0, frame.extended)
        case 0x60:
            return SdoRequest(
                node, "segment", 0, 0, b"", False, int(bool(specifier & TOGGLE)), frame.extended
            )
        case _:
            kind = "abort" if specifier == ABORT else "unknown"
            return SdoRequest(node, kind, index, subindex, rest, False, 0, frame.extended)


# -- replies ---------------------------------------------------------------------------------------------------


def reply_kind(specifier: int) -> str:
    """Kind of a reply with this byte 0, see `SdoReply`; "" for no reply."""
    kind = specifier & _KIND
    if kind == 0x40:
        return "upload" if specifier & _E else "upload-start"
    if specifier in (DOWNLOADED, ABORT):
        return "download" if specifier == DOWNLOADED else "abort"
    return "" if kind else "segment"


def decode_reply(data: bytes) -> SdoReply | None:
    """The data field of a reply; None for other than 8 bytes or an unknown specifier."""
    kind = reply_kind(data[0]) if len(data) == LENGTH else ""
    if not kind:
        return None
    specifier, index, subindex, rest = data[0], data[1] | data[2] << 8, data[3], data[4:]
    if kind == "segment":
        count = SEGMENT_BYTES - (specifier >> 1 & 7)
        toggle = int(bool(specifier & TOGGLE))
        return SdoReply(kind, 0, 0, data[1 : 1 + count], size=count, toggle=toggle, last=bool(specifier & 1))
    if kind == "upload":
        size = _size(specifier) if specifier & _S else None
        return SdoReply(kind, index, subindex, rest[:size], size=size)
    if kind == "upload-start":
        return SdoReply(
            kind, index, subindex, size=int.from_bytes(rest, "little") if specifier & _S else None
        )
    return SdoReply(kind, index, subindex, code=int.from_bytes(rest, "little") if kind == "abort" else 0)


def upload_head(index: int, subindex: int, size: int) -> bytes:
    """The first four bytes of an upload of `size` bytes that states its length; b"" if one reply cannot carry it."""
    if not 1 <= size <= EXPEDITED:
        return b""
    return bytes((0x40 | (EXPEDITED - size) << 2 | _E | _S,)) + _object(index, subindex)


def encode_upload_reply(
    node: int, index: int, subindex: int, data: bytes, *, extended: bool = False
) -> CanFrame:
    """The value of an object, 1 to 4 bytes: specifier 4F, 4B, 47, 43."""
    if not 1 <= len(data) <= EXPEDITED:
        raise _impossible(f"{len(data)} bytes do not fit one reply", "1 to 4 bytes")
    return _frame(REPLY, _one(node), upload_head(index, subindex, len(data)) + data, extended)


def encode_upload_start(
    node: int, index: int, subindex: int, size: int | None, *, extended: bool = False
) -> CanFrame:
    """Announce segments of `size` bytes in all: specifier 41; 40 without a stated size (None)."""
    if size is not None and not 0 <= size <= 0xFFFF_FFFF:
        raise _impossible(f"{size} bytes cannot be announced", "0 to 0xFFFFFFFF bytes")
    specifier, stated = (0x40, b"") if size is None else (0x40 | _S, size.to_bytes(4, "little"))
    return _frame(REPLY, _one(node), bytes((specifier,)) + _object(index, subindex) + stated, extended)


def encode_segment_reply(
    node: int, toggle: int, data: bytes, last: bool, *, extended: bool = False
) -> CanFrame:
    """One segment of at most 7 bytes, with the toggle of its request."""
    if len(data) > SEGMENT_BYTES:
        raise _impossible(f"{len(data)} bytes do not fit a segment", "0 to 7 bytes")
    specifier = _toggle_bit(toggle) | (SEGMENT_BYTES - len(data)) << 1 | int(last)
    return _frame(REPLY, _one(node), bytes((specifier,)) + data, extended)


def encode_download_reply(node: int, index: int, subindex: int, *, extended: bool = False) -> CanFrame:
    """Acknowledge a write: `60 il ih sub 00 00 00 00`."""
    return _frame(REPLY, _one(node), bytes((DOWNLOADED,)) + _object(index, subindex), extended)


def encode_abort_reply(
    node: int, index: int, subindex: int, code: int, *, extended: bool = False
) -> CanFrame:
    """Refuse a request: `80 il ih sub` and the code. Source: KST CAN protocol manual, command 9."""
    return _frame(REPLY, _one(node), _abort(index, subindex, code), extended)


# -- fields ----------------------------------------------------------------------------------------------------


def _frame(base: int, node: int, data: bytes, extended: bool) -> CanFrame:
    return CanFrame(base + node, data.ljust(LENGTH, b"\0"), extended)


def _size(specifier: int) -> int:
    return EXPEDITED - (specifier >> 2 & 3)


def _object(index: int, subindex: int) -> bytes:
    if not (0 <= index <= 0xFFFF and 0 <= subindex <= 0xFF):
        raise _impossible(
            f"object 0x{index:X}:{subindex} is impossible",
            "an index of 0 to 0xFFFF and a sub-index of 0 to 255",
        )
    return bytes((index & 0xFF, index >> 8, subindex))


def _abort(index: int, subindex: int, code: int) -> bytes:
    if not 0 <= code <= 0xFFFF_FFFF:
        raise _impossible(f"abort code {code} does not fit 32 bits", "0 to 0xFFFFFFFF")
    return bytes((ABORT,)) + _object(index, subindex) + code.to_bytes(4, "little")


def _toggle_bit(toggle: int) -> int:
    if toggle not in (0, 1):
        raise _impossible(f"toggle {toggle} is impossible", "0 or 1")
    return TOGGLE if toggle else 0


def _one(node: int) -> int:
    if node not in NODES:
        raise _impossible(f"{node} is not a node id", "1 to 127", node)
    return node


def _addressee(node: int) -> int:
    if node != BROADCAST and node not in NODES:
        raise _impossible(f"{node} is not a node id", "1 to 127, or 0 for all nodes", node)
    return node


def _impossible(summary: str, expected: str, node: int | None = None) -> RequestError:
    return RequestError(summary, expected=expected, advice="nothing was sent", node=node)


# -- keys ------------------------------------------------------------------------------------------------------


class Key:
    """What a reply has in common with its request beside the node: kind, index and sub-index, or a toggle.

    An abort does not say which kind of request it refuses, and the manual leaves open what it repeats. So an abort
    equals the requests with its index and sub-index, those with its index if its sub-index is 0, all if it says 0:0,
    and every segment. Equality is symmetric but not transitive, so all keys have one hash.
    """

    __slots__ = ("index", "kind", "subindex", "toggle")

    def __init__(self, kind: str, index: int = 0, subindex: int = 0, toggle: int = 0) -> None:
        self.kind: Final = kind
        self.index: Final = index
        self.subindex: Final = subindex
        self.toggle: Final = toggle

    def __hash__(self) -> int:
        return REPLY

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Key):
            return NotImplemented
        if self.kind == other.kind:
            return (
                self.index == other.index and self.subindex == other.subindex and self.toggle == other.toggle
            )
        if self.kind == "abort":
            return self._refuses(other)
        return other.kind == "abort" and other._refuses(self)

    def _refuses(self, request: Key) -> bool:
        if request.kind == "segment" or (self.index, self.subindex) == (0, 0):
            return True
        return self.index == request.index and self.subindex in (0, request.subindex)

    def __repr__(self) -> str:
        what = self.toggle if self.kind == "segment" else f"0x{self.index:04X}:{self.subindex}"
        return f"<Key {self.kind} {what}>"


def upload_due(node: int, index: int, subindex: int = 0) -> Expected:
    """The reply to `encode_upload`."""
    return Expected(node, Key("upload", index, subindex), LENGTH)


def download_due(node: int, index: int, subindex: int = 0) -> Expected:
    """The reply to `encode_download`."""
    return Expected(node, Key("download", index, subindex), LENGTH)


def segment_due(node: int, toggle: int) -> Expected:
    """The reply to `encode_segment`."""
    return Expected(node, Key("segment", toggle=int(toggle)), LENGTH)


# -- abort codes -----------------------------------------------------------------------------------------------

ABORTS: Final[Mapping[int, str]] = MappingProxyType(
    {
        0x0503_0000: "Toggle bit not alternated",
        0x0504_0000: "SDO protocol timed out",
        0x0504_0001: "Client/server command specifier not valid or unknown",
        0x0504_0002: "Invalid block size (block mode only)",
        0x0504_0003: "Invalid sequence number (block mode only)",
        0x0504_0004: "CRC error (block mode only)",
        0x0504_0005: "Out of memory",
        0x0601_0000: "Unsupported access to an object",
        0x0601_0001: "Attempt to read a write only object",
        0x0601_0002: "Attempt to write a read only object",
        0x0602_0000: "Object does not exist in the object dictionary",
        0x0604_0041: "Object cannot be mapped to the PDO",
        0x0604_0042: "The number and length of the objects to be mapped would exceed PDO length",
        0x0604_0043: "General parameter incompatibility reason",
        0x0604_0047: "General internal incompatibility in the device",
        0x0606_0000: "Access failed due to a hardware error",
        0x0607_0010: "Data type does not match, length of service parameter does not match",
        0x0607_0012: "Data type does not match, length of service parameter too high",
        0x0607_0013: "Data type does not match, length of service parameter too low",
        0x0609_0011: "Sub-index does not exist",
        0x0609_0030: "Value range of parameter exceeded (only for write access)",
        0x0609_0031: "Value of parameter written too high",
        0x0609_0032: "Value of parameter written too low",
        0x0609_0036: "Maximum value is less than minimum value",
        0x060A_0023: "Resource not available: SDO connection",
        0x0800_0000: "General error",
        0x0800_0020: "Data cannot be transferred or stored to the application",
        0x0800_0021: "Data cannot be transferred or stored to the application because of local control",
        0x0800_0022: "Data cannot be transferred or stored to the application because of the present device state",
        0x0800_0023: "Object dictionary dynamic generation fails or no object dictionary is present",
        0x0800_0024: "No data available",
    }
)
"""Code -> the words of the manual, which prints 29 codes of CiA 301, high word first ("0602 0000"); on the wire they
are little-endian. 0x060A0023 and 0x08000024 are from CiA 301 version 4.2."""


def meant_code(code: int) -> int:
    """The abort code, also from a node that sends its bytes in the wrong order: no code is another one reversed."""
    swapped = int.from_bytes(code.to_bytes(4, "little"), "big") if 0 <= code <= 0xFFFF_FFFF else code
    return swapped if code not in ABORTS and swapped in ABORTS else code


def abort_text(code: int) -> str:
    """The words for an abort code; an unknown code as hex, a byte-reversed one with what it must mean."""
    meant = meant_code(code)
    if meant not in ABORTS:
        return f"unknown abort code 0x{code:08X}"
    return (
        ABORTS[code]
        if meant == code
        else f"byte-swapped abort 0x{code:08X}, meaning 0x{meant:08X}: {ABORTS[meant]}"
    )
