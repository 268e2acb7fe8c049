"""Decode a recording of a bus into packets: requests, replies, notices, and the noise between them.

The family finds the frames; a `Decoder` adds their offsets and times. Noise is held until it ends, so the result does
not depend on where the recording is cut.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from math import inf
from typing import Final, NamedTuple

from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Family
from motorbus.core.recording import ABSENT, RecordedEvent, RecordedFrame
from motorbus.core.request import Data, Event, Noise, Notification
from motorbus.errors import RequestError

NOISE_LENGTH: Final = 1024
"""Bytes; a longer run of noise is split into packets of this length."""


class Packet(NamedTuple):
    """One frame of a recording, or a run of noise.

    `start`  offset in the recording, in bytes or CAN frames
    `data`   the whole frame; a CAN frame as `CanFrame.flat()` serializes it
    `kind`   "noise", or as in `RecordedFrame`
    `node`   sender or receiver; -1 for noise, and where the frame does not tell
    `code`   content as a number of the family; -1 for noise
    `fault`  "" for a valid frame, else "checksum", "framing" or "foreign"
    `at`     time (s) of its first byte; None where it was not recorded
    """

    start: int
    data: bytes
    kind: str
    node: int
    code: int
    fault: str
    at: float | None


class Decoder:
    """Decodes a recording of one family.

    `direction` of the data, unless `feed` gives another: "rx" from the devices, "tx" to them, "" unknown or both.
    Directions are decoded separately; offsets count all data. Raises RequestError for an unknown family or direction.
    """

    def __init__(self, family: str | Family, direction: str = "") -> None:
        self.family: Final = families.load(family) if isinstance(family, str) else family
        self._direction: Final = direction
        self._frames: Final = self.family.link.kind == "frames"
        self._streams: Final = {name: _Stream(self.family, name) for name in ("", "tx", "rx")}
        self._position = 0
        self._stream(direction)

    def feed(self, data: Data, at: float | None = None, direction: str | None = None) -> list[Packet]:
        """Take bytes, or one CAN frame, and the time (s) of their arrival; return the packets that are complete.

        Raises RequestError for an unknown direction and for data of the wrong kind of bus.
        """
        if self._frames != isinstance(data, CanFrame):
            expected = "a CanFrame" if self._frames else "bytes"
            raise RequestError(f"data of {self.family.name}: {type(data).__name__}", expected=expected)
        if not isinstance(data, CanFrame):
            data = bytes(data)  # a caller may reuse its buffer
        stream = self._stream(self._direction if direction is None else direction)
        start = self._position
        self._position += 1 if self._frames else len(data)
        return stream.feed(data, start, at)

    def flush(self) -> list[Packet]:
        """End of the recording: return the packets in the remaining data, one direction after the other."""
        return [packet for stream in self._streams.values() for packet in stream.flush()]

    def _stream(self, direction: str) -> _Stream:
        if direction not in self._streams:
            raise RequestError(
                f"direction {direction!r}",
                expected='"rx" from the devices, "tx" to them, "" both',
            )
        return self._streams[direction]


class _Chunk(NamedTuple):
    """Data that were fed together: the offset in their direction and in the recording, and their time (s)."""

    own: int
    start: int
    at: float | None


class _Stream:
    """The data of one direction."""

    def __init__(self, family: Family, direction: str) -> None:
        self._frames = family.link.kind == "frames"
        receiver = _FrameReceiver if self._frames else _ReplyReceiver
        self._receiver = family.recording(direction) or receiver(family)
        self._chunks: deque[_Chunk] = deque()
        self._fed = 0
        self._position = 0  # of the next packet
        self._noise = b""
        self._fault = ""

    def feed(self, data: Data, start: int, at: float | None) -> list[Packet]:
        self._chunks.append(_Chunk(self._fed, start, at))
        self._fed += 1 if self._frames else len(data)
        return self._packets(self._receiver.feed(data))

    def flush(self) -> list[Packet]:
        return self._packets(self._receiver.flush(), end=True) if self._chunks else []

    def _packets(self, events: list[RecordedEvent], end: bool = False) -> list[Packet]:
        packets: list[Packet] = []
        chunks, position = self._chunks, self._position
        own, start, at = chunks[0]
        limit = chunks[1].own if len(chunks) > 1 else inf
        for data, kind, node, code, fault in self._merged(events, end):
            while position >= limit:
                chunks.popleft()
                own, start, at = chunks[0]
                limit = chunks[1].own if len(chunks) > 1 else inf
            packets.append(Packet(start + position - own, data, kind, node, code, fault, at))
            position += 1 if self._frames else len(data)
        self._position = position
        return packets

    def _merged(self, events: list[RecordedEvent], end: bool) -> Iterator[tuple[bytes, str, int, int, str]]:
        """Yield data, kind, node, code and fault of each packet; consecutive noise with one fault is one packet."""
        for event in events:
            if not isinstance(event, Noise):
                if self._noise:
                    yield self._noise, "noise", ABSENT, ABSENT, self._fault
                    self._noise = b""
                data, kind, node, code = event
                yield data, kind, node, code, ""
                continue
            if self._noise and (event.fault != self._fault or self._frames):
                yield self._noise, "noise", ABSENT, ABSENT, self._fault
                self._noise = b""
            self._noise += event.data
            self._fault = event.fault
            while len(self._noise) >= NOISE_LENGTH:
                yield self._noise[:NOISE_LENGTH], "noise", ABSENT, ABSENT, self._fault
                self._noise = self._noise[NOISE_LENGTH:]
        if self._noise and (end or self._frames):
            yield self._noise, "noise", ABSENT, ABSENT, self._fault
            self._noise = b""


class _FrameReceiver:
    """CAN frames, each explained by itself: its identifier gives the direction."""

    def __init__(self, family: Family) -> None:
        self._driver = family.open()

    def feed(self, data: Data) -> list[RecordedEvent]:
        assert isinstance(data, CanFrame)
        (one,) = self._driver.decode(data.flat())
        if not one.kind:
            return [Noise(one.data, "foreign")]
        return [RecordedFrame(one.data, one.kind, one.node, one.code)]

    def flush(self) -> list[RecordedEvent]:
        return []


class _ReplyReceiver:
    """Replies and notices of a serial bus whose family has no receiver for recordings."""

    def __init__(self, family: Family) -> None:
        self._receiver = family.open().receiver()

    def feed(self, data: Data) -> list[RecordedEvent]:
        return [self._recorded(event) for event in self._receiver.feed(data)]

    def flush(self) -> list[RecordedEvent]:
        return [self._recorded(event) for event in self._receiver.flush()]

    def _recorded(self, event: Event) -> RecordedEvent:
        if isinstance(event, Noise):
            return Noise(event.data, event.fault)
        if isinstance(event, Notification):
            return RecordedFrame(event.data, "notice", event.node, ABSENT)
        return RecordedFrame(event.data, "reply", ABSENT, ABSENT)
