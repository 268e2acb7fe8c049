"""WIRE: what the frames mean. Here belong encoding, decoding, and where a frame begins and ends.

No register names, no clock, no I/O. Nothing here ever raises on what a device sent; only a caller who asks for the
impossible gets an error. Metronome servos (README.md) talk in classic CAN frames with 11-bit identifiers:

    request  0x200 + node   8 bytes: command, index, subindex, 0, value (4, big-endian)     node 0: everyone
    answer   0x280 + node   8 bytes: command | 0x80, index, subindex, status, value (4)
    report   0x280 + node   5 bytes: reason, present position (4), sent without being asked

So a report and an answer share their identifier and are told apart by their length. The low half of `status` says
why a request was refused, the high half holds alarm bits, which do not make an answer a refusal.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Explanation, Part
from motorbus.core.request import Data, Event, Key, Noise, Notification, Reply
from motorbus.errors import RequestError

REQUEST: Final = 0x200
ANSWER: Final = 0x280
EVERYONE: Final = 0
NODES: Final = range(1, 64)
LENGTH: Final = 8
"""Data bytes of a request and of an answer; a report has `REPORT_LENGTH`."""
REPORT_LENGTH: Final = 5
PROOF: Final = 0x01
"""Index of an object whose value at every subindex is the subindex with its bits inverted."""
REFUSALS: Final = {1: "no such object", 2: "read only", 3: "out of range", 4: "locked", 5: "unknown command"}
ALARMS: Final = {4: "temperature"}
"""Bits of `status` that are alarms."""


class Command(IntEnum):
    """What a request asks for."""

    READ = 1
    WRITE = 2
    STOP = 3


class Reason(IntEnum):
    """Why a report was sent."""

    UNDER_WAY = 0
    ARRIVED = 1


class Message(NamedTuple):
    """A request (`status` 0) or an answer, taken apart."""

    node: int
    command: int
    object: int
    subindex: int
    status: int
    value: bytes

    @property
    def key(self) -> Key:
        """What an answer has in common with its request. (The lane tells the node.)"""
        return (self.command, self.object, self.subindex)


def encode_request(
    node: int, command: Command, index: int = 0, subindex: int = 0, value: bytes = b""
) -> CanFrame:
    """A request to one node, 1 to 63, or to 0, everyone. Raises RequestError for other nodes."""
    if node not in (EVERYONE, *NODES):
        raise RequestError(
            f"{node} is not a node id", expected="1 to 63, or 0 for everyone", advice="nothing was sent"
        )
    return CanFrame(REQUEST + node, bytes((command, index, subindex, 0)) + value.rjust(4, b"\0"))


def encode_answer(request: Message, status: int, value: bytes = b"") -> CanFrame:
    """What a device says to a request."""
    head = bytes((request.command | 0x80, request.object, request.subindex, status))
    return CanFrame(ANSWER + request.node, head + value.rjust(4, b"\0"))


def encode_report(node: int, reason: Reason, position: bytes) -> CanFrame:
    """What a device says on its own account."""
    return CanFrame(ANSWER + node, bytes((reason,)) + position)


def decode_request(frame: CanFrame) -> Message | None:
    """For the simulator: a request that all devices understand, or None."""
    node, data = frame.id - REQUEST, frame.data
    if frame.extended or node not in (EVERYONE, *NODES) or len(data) != LENGTH:
        return None
    return Message(node, data[0], data[1], data[2], 0, data[4:])


def decode_answer(frame: CanFrame) -> Message | None:
    """An answer of some device, or None."""
    node, data = frame.id - ANSWER, frame.data
    if frame.extended or node not in NODES or len(data) != LENGTH or data[0] & 0x7F not in set(Command):
        return None
    return Message(node, data[0] & 0x7F, data[1], data[2], data[3], data[4:]) if data[0] & 0x80 else None


def decode_report(frame: CanFrame) -> tuple[int, Reason, bytes] | None:
    """Node, reason and position of a report, or None."""
    node, data = frame.id - ANSWER, frame.data
    if frame.extended or node not in NODES or len(data) != REPORT_LENGTH or data[0] not in set(Reason):
        return None
    return node, Reason(data[0]), data[1:]


def alarms(status: int) -> tuple[str, ...]:
    """The names of the alarm bits that are set."""
    return tuple(name for bit, name in ALARMS.items() if status >> bit & 1)


class FrameReceiver:
    """Answers, reports, and what is neither. One frame is one event, so nothing is ever held back."""

    held = 0

    def feed(self, data: Data) -> list[Event]:
        """Take one frame; give what it is. Never raises."""
        if not isinstance(data, CanFrame):
            return [Noise(data, "foreign")] if data else []
        return [_event(data)]

    def flush(self) -> list[Event]:
        """Nothing is held back."""
        return []


def _event(frame: CanFrame) -> Event:
    if (answer := decode_answer(frame)) is not None:
        return Reply(answer.node, answer.key, frame.data)
    if (report := decode_report(frame)) is not None:
        node, reason, _ = report
        return Notification(node, reason.name.lower(), frame.data)
    return Noise(
        frame.data, "foreign"
    )  # a frame stands by itself: a senseless one casts no doubt on the next


# --- in words -----------------------------------------------------------------------------------------------

HEAD: Final = 5
"""In a run of bytes a CAN frame stands as `CanFrame.flat()` says: identifier (4), number of data bytes (1), data."""


def explain(data: bytes) -> list[Explanation]:
    """Every frame in a run of bytes, field by field, and why a bad one is bad."""
    told: list[Explanation] = []
    while data:
        size = HEAD + data[4] if len(data) >= HEAD else HEAD
        if len(data) < size or data[4] > LENGTH:
            return [*told, _bad(data, "not a whole CAN frame: identifier (4 bytes), length, data")]
        told.append(_explained(data[:size]))
        data = data[size:]
    return told


def _explained(data: bytes) -> Explanation:
    identifier = int.from_bytes(data[:4], "big")
    frame = CanFrame(identifier & 0x1FFF_FFFF, data[HEAD:], bool(identifier >> 31))
    request, answer, report = decode_request(frame), decode_answer(frame), decode_report(frame)
    if report is not None:
        fields = [(1, "reason", report[1].name.lower()), (4, "position", f"{_signed(report[2])}")]
        return _good(data, f"report of node {report[0]}", fields)
    if answer is not None:
        return _good(data, f"answer of node {answer.node}", [*_object(answer), *_said(answer)])
    if request is not None and request.command in set(Command):
        who = f"node {request.node}" if request.node else "everyone"
        return _good(data, f"request to {who}", [*_object(request), (1, "zero", ""), _value(request)])
    return _bad(data, "no frame of this family has this identifier, length and command")


def _object(message: Message) -> Iterator[tuple[int, str, str]]:
    yield 1, "command", Command(message.command).name.lower()
    yield 1, "index", f"0x{message.object:02X}"
    yield 1, "subindex", f"{message.subindex}"


def _said(answer: Message) -> Iterator[tuple[int, str, str]]:
    refusal = REFUSALS.get(answer.status & 0x0F, "refused") if answer.status & 0x0F else "done"
    yield 1, "status", ", ".join((refusal, *(f"alarm: {name}" for name in alarms(answer.status))))
    yield _value(answer)


def _value(message: Message) -> tuple[int, str, str]:
    return 4, "value", f"{_signed(message.value)}"


def _signed(data: bytes) -> int:
    return int.from_bytes(data, "big", signed=True)


def _good(data: bytes, title: str, fields: list[tuple[int, str, str]]) -> Explanation:
    parts = [Part(0, data[:4], "identifier", title), Part(4, data[4:HEAD], "length", f"{data[4]} bytes")]
    start = HEAD
    for size, name, meaning in fields:
        parts.append(Part(start, data[start : start + size], name, meaning))
        start += size
    return Explanation(data, title, tuple(parts))


def _bad(data: bytes, fault: str) -> Explanation:
    return Explanation(data, "no frame", (Part(0, data, "bytes", fault),), fault)
