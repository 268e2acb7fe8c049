"""Frames of a recorded line: of the controller, of a host, or of both."""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.core.request import Noise
from motorbus.families.stepper import protocol
from motorbus.families.stepper.protocol import DUMP_LENGTH, HEADER, NOTICE, REPLY_LENGTH, REQUEST_LENGTH


class Recording:
    """Parses recorded frames; see `core.recording.RecordingReceiver`.

    Requests and replies have the same header, and a reply has no checksum. In this order: eleven bytes
    with a correct checksum are a request; the head of a dump starts a dump; eleven bytes with another
    checksum are a damaged request if no frame starts in them, or behind a reply; six bytes in the form of
    a reply are one. A frame that is incomplete at the end is noise and not searched.
    """

    def __init__(self, direction: str = "") -> None:
        self._direction: Final = direction
        self._rest = b""

    def feed(self, data: Any) -> list[RecordedEvent]:
        """Take a chunk of bytes; return the events that are complete."""
        return self._split(self._rest + data, at_end=False)

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the frames in the held bytes, and the remainder as noise."""
        return self._split(self._rest, at_end=True)

    def _split(self, data: bytes, *, at_end: bool) -> list[RecordedEvent]:
        events: list[RecordedEvent] = []
        start = noise = 0
        while start < len(data):
            head = data[start : start + REQUEST_LENGTH]
            if not at_end and self._needs_more(head):
                break
            size, kind = self._frame(head)
            end = start + (size or 1)
            if end > len(data):
                start = len(data) if at_end else start
                break
            if kind:
                _add_noise(events, data[noise:start])
                events.append(_event(data[start:end], kind))
                noise = end
            start = end
        _add_noise(events, data[noise:start])
        self._rest = data[start:]
        return events

    def _needs_more(self, head: bytes) -> bool:
        needed = REPLY_LENGTH if self._direction == "rx" else REQUEST_LENGTH
        return len(head) < needed and HEADER.startswith(head[:2])

    def _frame(self, head: bytes) -> tuple[int, str]:
        """Length and kind of the frame that begins with these eleven bytes, fewer at the end; 0: none."""
        if NOTICE.startswith(head[:2]):
            return (0, "") if self._direction == "tx" else (len(NOTICE), "notice")
        if head[:2] != HEADER:
            return 0, ""
        if self._direction != "rx" and protocol.is_request(head):
            return REQUEST_LENGTH, "request"
        is_reply = self._direction != "tx" and len(head) >= REPLY_LENGTH and protocol.is_reply(head)
        if is_reply and head[2] == protocol.READ_PROJECT:
            return DUMP_LENGTH, "reply"
        rest = head[REPLY_LENGTH:] if is_reply else head[2:]
        if self._direction != "rx" and len(head) == REQUEST_LENGTH and not _starts_in(rest):
            return REQUEST_LENGTH, "damaged"
        return (REPLY_LENGTH, "reply") if is_reply else (0, "")


def _starts_in(data: bytes) -> bool:
    return HEADER in data or NOTICE in data or data[-1:] in (HEADER[:1], NOTICE[:1])


def _event(data: bytes, kind: str) -> RecordedEvent:
    if kind == "damaged":
        return Noise(data, "checksum")
    return RecordedFrame(data, kind, protocol.ONLY, int.from_bytes(data[2:4] or data, "big"))


def _add_noise(events: list[RecordedEvent], data: bytes) -> None:
    if data:
        events.append(Noise(data, "framing"))
