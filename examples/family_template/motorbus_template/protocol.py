"""The frames of the Metronome protocol: encode, decode, and find them in a run of bytes.

    request  AA 55  id  size  command  operands…  crc (2)      size: command and operands
    reply    AA 5A  id  size  status   data…      crc (2)      size: status and data

The checksum is CRC-16/IBM-3740 over id to the last byte before it. All numbers are little-endian.
"""

from __future__ import annotations

from binascii import crc_hqx
from enum import IntEnum
from typing import Final

from motorbus.core.decode import Fields, counted
from motorbus.core.family import Explanation
from motorbus.core.framing import FrameParser

RATE: Final = 500_000  # bit/s as shipped
IDS: Final = range(1, 64)
BROADCAST: Final = 0
REQUEST: Final = b"\xaa\x55"
REPLY: Final = b"\xaa\x5a"
OVERHEAD: Final = 7
"""Bytes of a reply without data: header, id, size, status, checksum."""
STATUS: Final = {
    0: "done",
    1: "no such register",
    2: "read only",
    3: "out of range",
    4: "locked",
    5: "unknown command",
}
"""The low half of the status: 0, or the code of a refusal."""
HOT: Final = 0x10
"""The alarm bit of the status. It refuses nothing."""


class Command(IntEnum):
    """READ address count; WRITE address data; STOP."""

    READ = 1
    WRITE = 2
    STOP = 3


def crc(data: bytes) -> bytes:
    """CRC-16/IBM-3740 (polynomial 0x1021, initial value 0xFFFF)."""
    return crc_hqx(data, 0xFFFF).to_bytes(2, "little")


def encode(header: bytes, id: int, code: int, data: bytes = b"") -> bytes:
    """A request with its command and operands, or a reply with its status and data."""
    body = bytes((id, 1 + len(data), code)) + data
    return header + body + crc(body)


def parser(*headers: bytes) -> FrameParser:
    """Finds frames with one of these headers."""

    def length(data: bytes) -> int | None:
        if len(data) < 4:
            return None
        return 6 + data[3] if 1 <= data[3] <= 33 else 0

    return FrameParser(headers, length, lambda frame: crc(frame[2:-2]) == frame[-2:])


def decode(data: bytes) -> list[Explanation]:
    """Explain each frame in these bytes, field by field, and the fault of other bytes."""
    found = []
    for frame, fault in parser(REQUEST, REPLY).feed(data, end=True):
        fields = Fields(frame)
        if fault:
            title = "no frame"
            fields.take_rest("bytes", fault)
        else:
            title = "reply" if frame.startswith(REPLY) else "request"
            fields.take(2, "header", title)
            fields.take(1, "id", str(frame[2] or "all"))
            fields.take(1, "size", counted(frame[3]))
            if title == "reply":
                alarm = ", alarm" if frame[4] & HOT else ""
                fields.take(1, "status", STATUS.get(frame[4] & 15, "unknown refusal") + alarm)
            else:
                fields.take(1, "command", Command(frame[4]).name if frame[4] in set(Command) else "unknown")
            fields.take(frame[3] - 1, "data", frame[5:-2].hex(" "))
            fields.take(2, "checksum", "correct")
        found.append(Explanation(frame, title, tuple(fields.parts), fault))
    return found
