"""Frames of a recorded line of a controller: of the controller, of a host, or of both."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.core.request import Noise
from motorbus.families.stepper.wire import frames
from motorbus.families.stepper.wire.frames import (
    DUMP,
    DUMP_LENGTH,
    HEADER,
    ONLY,
    REPLY_LENGTH,
    REQUEST_LENGTH,
    is_sound,
    reply_fault,
)

_STARTS: Final = (HEADER[0], frames.NOTICE[0])


class _Start(NamedTuple):
    """A frame that starts here: its length and kind. Or no frame (0), and the bytes of a damaged request."""

    length: int
    kind: str
    damaged: int = 0


_NO_FRAME: Final = _Start(0, "noise")
_DAMAGED_REQUEST: Final = _Start(0, "noise", REQUEST_LENGTH)


class Recording:
    """A receiver of recorded frames; see `core.recording.RecordingReceiver`. It ignores pauses between bytes.

    Requests and replies have the same header, and a reply has no checksum. In this order: eleven bytes with a valid
    checksum are a request; the head of a dump starts a dump; eleven bytes with another checksum are a damaged request
    if no frame starts in the last five; six bytes that a reply may have are a reply. Any other byte is noise. A frame
    that is incomplete at the end is noise and not searched, because a dump may contain anything.
    """

    code_meaning: Final = "bytes 2 and 3 of a request or a reply, which tell the command; EE DD of the notice"

    def __init__(self, direction: str = "") -> None:
        self._direction: Final = direction
        self._rest = b""
        self._damaged = 0  # bytes of the rest that belong to a damaged request

    def feed(self, data: Any) -> list[RecordedEvent]:
        """Take a chunk of bytes; return the events that are complete."""
        return self._split(self._rest + data, more=True)

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the frames in the held bytes, and the remainder as noise."""
        return self._split(self._rest, more=False)

    def _split(self, data: bytes, more: bool) -> list[RecordedEvent]:
        events: list[RecordedEvent] = []
        position = 0
        while position < len(data):
            head = data[position : position + REQUEST_LENGTH]
            if more and self._is_undecided(head):
                break
            length, kind, damaged = self._start(head)
            end = position + length
            if end > len(data) and more:
                break
            if length:
                self._damaged = 0
                whole = data[position:end]
                if end > len(data):
                    events.append(Noise(whole, "framing"))
                else:
                    code = int.from_bytes(whole[2:4] or whole, "big")
                    events.append(RecordedFrame(whole, kind, ONLY, code))
            else:
                places = (data.find(byte, position + 1) for byte in _STARTS)
                end = min((place for place in places if place >= 0), default=len(data))
                self._damaged = max(self._damaged, damaged)
                self._add_noise(events, data[position:end])
            position = end
        self._rest = data[position:]
        return events

    def _start(self, head: bytes) -> _Start:
        """The frame that starts with these eleven bytes, fewer at the end of the recording."""
        direction = self._direction
        if head[:2] == frames.NOTICE:
            return _NO_FRAME if direction == "tx" else _Start(2, "notice")
        if head[:2] != HEADER:
            return _NO_FRAME
        if direction != "rx" and is_sound(head):
            return _Start(REQUEST_LENGTH, "request")
        is_reply = direction != "tx" and len(head) >= REPLY_LENGTH and not reply_fault(head)
        if is_reply and head[2] == DUMP.code:
            return _Start(DUMP_LENGTH, "reply")
        if direction != "rx" and len(head) == REQUEST_LENGTH:
            last = head[REPLY_LENGTH:]
            is_start_inside = HEADER in last or frames.NOTICE in last or last[-1] in _STARTS
            if direction == "tx" or not is_start_inside:
                return _DAMAGED_REQUEST
        return _Start(REPLY_LENGTH, "reply") if is_reply else _NO_FRAME

    def _is_undecided(self, head: bytes) -> bool:
        """More bytes are needed to identify the frame that starts here."""
        if len(head) < 2:
            return head[0] in _STARTS
        needed = REPLY_LENGTH if self._direction == "rx" else REQUEST_LENGTH
        return head[:2] == HEADER and len(head) < needed

    def _add_noise(self, events: list[RecordedEvent], noise: bytes) -> None:
        damaged, stray = noise[: self._damaged], noise[self._damaged :]
        if damaged:
            events.append(Noise(damaged, "checksum"))
        if stray:
            events.append(Noise(stray, "framing"))
        self._damaged -= len(damaged)
