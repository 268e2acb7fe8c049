"""The frames of the Metronome protocol: encode, decode, and find replies in a run of bytes.

    request  AA 55  id  size  command  operands…  crc (2)      size: command and operands
    reply    AA 5A  id  size  status   data…      crc (2)      size: status and data

The checksum is CRC-16/MODBUS over id to the last byte before it, low byte first. All numbers are little-endian.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from motorbus.core.decode import Fields
from motorbus.core.family import Explanation, Part
from motorbus.core.framing import FrameParser, FrameReceiver
from motorbus.errors import RequestError

IDS: Final = range(1, 64)
BROADCAST: Final = 0
REQUEST: Final = b"\xaa\x55"
REPLY: Final = b"\xaa\x5a"
OVERHEAD: Final = 7
"""Bytes of a reply without data: header, id, size, status, checksum."""
MOST_DATA: Final = 32
REFUSALS: Final = {
    1: "no such register",
    2: "read only",
    3: "out of range",
    4: "locked",
    5: "unknown command",
}
"""The low half of the status; 0 is done."""
ALARMS: Final = {4: "temperature"}
"""Bits of the status that are alarms; they refuse nothing."""


class Command(IntEnum):
    """READ address count; WRITE address data; STOP."""

    READ = 1
    WRITE = 2
    STOP = 3


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def encode_request(id: int, command: Command, operands: bytes = b"") -> bytes:
    """A request to one device, or to all (`BROADCAST`), which do not reply. Raises RequestError for another id."""
    if id not in IDS and id != BROADCAST:
        raise RequestError(
            f"{id} is not a node id", expected="1 to 63, or 0 for all", advice="nothing was sent"
        )
    body = bytes((id, 1 + len(operands), command)) + operands
    return REQUEST + body + crc(body)


def encode_reply(id: int, status: int, data: bytes = b"") -> bytes:
    """A reply, for the simulator."""
    body = bytes((id, 1 + len(data), status)) + data
    return REPLY + body + crc(body)


def alarms(status: int) -> tuple[str, ...]:
    """The names of the alarm bits that are set."""
    return tuple(name for bit, name in ALARMS.items() if status >> bit & 1)


def status_text(status: int) -> str:
    """The refusal and the alarms."""
    refusal = REFUSALS.get(status & 15, f"refusal {status & 15}") if status & 15 else "done"
    return ", ".join((refusal, *(f"alarm: {name}" for name in alarms(status))))


def _length(data: bytes) -> int | None:
    """Bytes of the frame that begins so; 0 for an impossible size."""
    if len(data) < 4:
        return None
    return 6 + data[3] if 1 <= data[3] <= 1 + MOST_DATA else 0


def parser(*headers: bytes) -> FrameParser:
    """Finds frames with one of these headers."""
    return FrameParser(headers, _length, lambda frame: crc(frame[2:-2]) == frame[-2:])


def receiver() -> FrameReceiver:
    """Finds replies; the id is the key of a reply."""
    return FrameReceiver(parser(REPLY), lambda frame: frame[2])


def decode(data: bytes) -> list[Explanation]:
    """Explain each frame in these bytes, field by field, and the fault of other bytes."""
    found = parser(REQUEST, REPLY).feed(data, end=True)
    return [
        Explanation(one, "no frame", (Part(0, one, "bytes", fault),), fault) if fault else _explain(one)
        for one, fault in found
    ]


def _explain(frame: bytes) -> Explanation:
    is_reply, id, code = frame.startswith(REPLY), frame[2], frame[4]
    target = f"device {id}" if id else "all devices"
    fields = Fields(frame)
    fields.take(2, "header", "reply" if is_reply else "request")
    fields.take(1, "id", target)
    fields.take(1, "size", f"{frame[3]} bytes")
    if is_reply:
        title, name, meaning = f"reply of {target}", "status", status_text(code)
    else:
        meaning = Command(code).name if code in set(Command) else f"command {code}"
        title, name = f"{meaning} to {target}", "command"
    fields.take(1, name, meaning)
    fields.take(frame[3] - 1, "data", frame[5:-2].hex(" "))
    fields.take(2, "checksum", "correct")
    return Explanation(frame, title, tuple(fields.parts))
