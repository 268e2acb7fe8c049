"""SDO frames of KST CAN servos: requests, replies and abort codes.

    request   0x600 + node   8 bytes: specifier, index (2), sub-index, data (4), little-endian; node 0: all nodes
    reply     0x580 + node   8 bytes of the same form; an abort carries a code

Byte 0, the specifier: bits 7 to 5 are the kind; bit 1 (e): the data are in this frame, bit 0 (s): their length is
stated, bits 3 and 2 (n): how many of the four data bytes are unused. Reserved bits are ignored (CiA 301).

Encoders make frames with 11-bit identifiers; `CanFrame._replace(extended=True)` makes one of 29 bits.

Source: KST CAN protocol manual, commands 1 to 9; CiA 301 for the specifier. Segments, in which longer values
come (CiA 301), are not read. Frames from a device never raise an error here. An id above 127 raises RequestError.
"""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct
from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Expected
from motorbus.errors import RequestError

REQUEST: Final = 0x600  # identifier of a request, plus the node
REPLY: Final = 0x580  # identifier of a reply, plus the node
BROADCAST: Final = 0
NODES: Final = range(1, 128)
LENGTH: Final = 8  # data bytes of each request and reply
EXPEDITED: Final = 4  # maximum number of value bytes in one frame

UPLOAD: Final = 0x40
DOWNLOAD: Final = 0x20
DOWNLOADED: Final = 0x60
ABORT: Final = 0x80
_KIND: Final = 0xE0
_E: Final = 2
_S: Final = 1
_HEAD: Final = Struct("<BHB")  # specifier, index, sub-index


class Sdo(NamedTuple):
    """A decoded request or reply: "upload", "download" or "abort", of a reply also "segments" (which follow).

    `size` is the stated number of bytes of `data`; without it (None) `data` are bytes 4 to 7.
    """

    kind: str
    index: int  # type: ignore[assignment]  # hides tuple.index
    subindex: int = 0
    data: bytes = b""
    size: int | None = None

    @property
    def code(self) -> int:
        """The code of an abort."""
        return int.from_bytes(self.data, "little")


def request_kind(specifier: int) -> str:
    """Kind of a request with this byte 0; "" for no request."""
    match specifier & _KIND:
        case 0x40:
            return "upload"
        case 0x20 if specifier & _E:
            return "download"
    return "abort" if specifier == ABORT else ""


def reply_kind(specifier: int) -> str:
    """Kind of a reply with this byte 0; "" for no reply."""
    if specifier & _KIND == UPLOAD:
        return "upload" if specifier & _E else "segments"
    return {DOWNLOADED: "download", ABORT: "abort"}.get(specifier, "")


def decode_request(data: bytes) -> Sdo | None:
    """The data field of a request; None for other than 8 bytes or an unknown specifier."""
    return _decode(data, request_kind(data[0]), "download") if len(data) == LENGTH else None


def decode_reply(data: bytes) -> Sdo | None:
    """The data field of a reply; None for other than 8 bytes or an unknown specifier."""
    return _decode(data, reply_kind(data[0]), "upload") if len(data) == LENGTH else None


def _decode(data: bytes, kind: str, with_value: str) -> Sdo | None:
    specifier, index, subindex = _HEAD.unpack_from(data)
    size = EXPEDITED - (specifier >> 2 & 3) if kind == with_value and specifier & _S else None
    value = data[_HEAD.size :][:size]
    return Sdo(kind, index, subindex, value, size) if kind else None


def encode_upload(node: int, index: int, subindex: int = 0) -> CanFrame:
    """Read an object of one node or of all (0): `40 il ih sub 00 00 00 00`."""
    return _frame(REQUEST, node, UPLOAD, index, subindex)


def encode_download(node: int, index: int, subindex: int, data: bytes, *, sized: bool = False) -> CanFrame:
    """Write 1 to 4 bytes to an object of one node or of all (0): specifier 0x22, or `sized` as in CiA 301."""
    return _frame(REQUEST, node, DOWNLOAD | (_stated(data) if sized else _E), index, subindex, data)


def encode_upload_reply(node: int, index: int, subindex: int, data: bytes) -> CanFrame:
    """The value of an object, 1 to 4 bytes: specifier 4F, 4B, 47, 43."""
    return _frame(REPLY, node, UPLOAD | _stated(data), index, subindex, data)


def encode_download_reply(node: int, index: int, subindex: int) -> CanFrame:
    """Acknowledge a write: `60 il ih sub 00 00 00 00`."""
    return _frame(REPLY, node, DOWNLOADED, index, subindex)


def encode_abort_reply(node: int, index: int, subindex: int, code: int) -> CanFrame:
    """Refuse a request: `80 il ih sub` and the code. Source: KST CAN protocol manual, command 9."""
    return _frame(REPLY, node, ABORT, index, subindex, code.to_bytes(4, "little"))


def _stated(data: bytes) -> int:
    return (EXPEDITED - len(data)) << 2 | _E | _S


def _frame(base: int, node: int, specifier: int, index: int, subindex: int, data: bytes = b"") -> CanFrame:
    if not BROADCAST <= node < NODES.stop:
        raise RequestError(f"{node} is not a node id", expected="0 to 127", node=node)
    return CanFrame(base + node, (_HEAD.pack(specifier, index, subindex) + data).ljust(LENGTH, b"\0"))


def expected(node: int, kind: str, index: int, subindex: int = 0) -> Expected:
    """The reply to a request of this kind ("upload" or "download"): node, kind, index and sub-index match.

    The manual leaves open what an abort repeats: index and sub-index, index and 0, or 0 and 0.
    """
    refusals = tuple(("abort", *place) for place in ((index, subindex), (index, 0), (0, 0)))
    return Expected(node, (kind, index, subindex), LENGTH, refusals=refusals)


ABORTS: Final[Mapping[int, str]] = {
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
    if meant != code:
        return f"byte-swapped abort 0x{code:08X}, meaning 0x{meant:08X}: {ABORTS[meant]}"
    return ABORTS[code]
