"""Packets out of a stream of bytes that may be cut anywhere, begin anywhere, and be wrong anywhere.

There is no byte stuffing, so FF FF proves nothing: a packet is one only when id, length and checksum agree.
Whatever fails is given up by ONE byte, never by the length it claimed, so that a good packet inside a bad one
is not lost. What may still become a packet waits (at most 258 bytes); `flush` says that nothing more comes.

Each byte ends in exactly one event. Noise is "checksum" for the bytes of a whole packet whose checksum is
wrong, else "framing". How the stream was cut changes neither packets nor these words, only whether a run of
noise comes in one piece.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Literal, TypeAlias, TypeVar

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Event, Noise, Reply
from motorbus.families.feetech.wire.packets import (
    BROADCAST,
    HEADER,
    MAX_ID,
    MAX_LENGTH,
    OVERHEAD,
    SOUND,
    InstructionPacket,
    StatusPacket,
    is_sound,
)

P = TypeVar("P")
Direction: TypeAlias = Literal["status", "instruction"]
Packet: TypeAlias = StatusPacket | InstructionPacket


class Stream(Generic[P]):
    """Finds packets with an id up to `top`; an event is the result of `make` for each."""

    __slots__ = ("_damaged", "_make", "_rest", "_top")

    def __init__(self, top: int, make: Callable[[bytes], P]) -> None:
        self._top = top
        self._make = make
        self._rest = b""
        self._damaged = 0  # bytes of the rest that belong to a packet with a wrong checksum

    @property
    def held(self) -> int:
        """How many bytes wait for more."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[P | Noise]:
        """Take a chunk of bytes; return the events that are complete."""
        return self._split(self._rest + data if self._rest else data, more=True)

    def flush(self) -> list[P | Noise]:
        """End of data: return the packets in the held bytes, and the remainder as noise."""
        return self._split(self._rest, more=False)

    def _split(self, data: bytes, more: bool) -> list[P | Noise]:
        """Return the packets and the noise in `data`. Consecutive valid packets need no search."""
        events: list[P | Noise] = []
        start, end, make, top = 0, len(data), self._make, self._top
        while True:
            while end - start >= OVERHEAD and not self._damaged:
                stop = start + data[start + 3] + 4
                packet = data[start:stop]
                if stop > end or packet[2] > top or packet[3] < 2 or packet[:2] != HEADER:
                    break
                if sum(packet) & 0xFF != SOUND:
                    break
                events.append(make(packet))
                start = stop
            if start == end:
                self._rest = b""
                return events
            start = self._search(data, start, events, more)
            if start < 0:
                return events

    def _search(self, data: bytes, position: int, events: list[P | Noise], more: bool) -> int:
        """Return the start of the next packet and add the noise before it; -1 if there is none, then keep the rest."""
        noise = position  # start of the noise that is not in `events` yet
        end = len(data)
        while (start := data.find(HEADER, position)) >= 0:
            size = self._size(data, start)
            if start + size > end and more:
                position = start
                break
            position = start + 1 if size else _behind(data, start)
            if not size or start + size > end:
                continue
            if is_sound(data[start : start + size]):
                self._add_noise(events, data[noise:start])
                self._damaged = 0
                return start
            noise = self._add_damaged(events, data, noise, start, size)
        else:
            position = end - 1 if more and position < end and data[-1] == 0xFF else end
        self._add_noise(events, data[noise:position])
        self._rest = data[position:]
        return -1

    def _size(self, data: bytes, start: int) -> int:
        """How many bytes the packet at this header has (at least, when unknown yet); 0: it is none."""
        have = len(data) - start
        if have > 2 and data[start + 2] > self._top:
            return 0
        if have > 3:
            return data[start + 3] + 4 if data[start + 3] >= 2 else 0
        return OVERHEAD

    def _add_damaged(self, events: list[P | Noise], data: bytes, noise: int, start: int, size: int) -> int:
        """Mark a whole packet with a wrong checksum; return the start of the noise that is not in `events` yet."""
        if start - noise >= self._damaged:
            self._add_noise(events, data[noise:start])
            noise = start
        self._damaged = max(self._damaged, start + size - noise)
        return noise

    def _add_noise(self, events: list[P | Noise], noise: bytes) -> None:
        bad, stray = noise[: self._damaged], noise[self._damaged :]
        if bad:
            events.append(Noise(bad, "checksum"))
        if stray:
            events.append(Noise(stray, "framing"))
        self._damaged -= len(bad)


class Splitter:
    """Packets of one direction, "status" (from servos) or "instruction" (from a host), and the noise."""

    __slots__ = ("_stream",)

    def __init__(self, direction: Direction = "status") -> None:
        self._stream: Stream[Packet] = (
            Stream(MAX_ID, _status) if direction == "status" else Stream(BROADCAST, _instruction)
        )

    @property
    def held(self) -> int:
        """How many bytes wait for more."""
        return self._stream.held

    def feed(self, data: bytes) -> list[Packet | Noise]:
        """Take bytes, cut anywhere; give what is complete. Never raises."""
        return self._stream.feed(data)

    def flush(self) -> list[Packet | Noise]:
        """Nothing more comes: give what can be made of the rest."""
        return self._stream.flush()


class StatusReceiver:
    """What a bus makes of the bytes of servos: each status packet a `Reply` on lane 0 with the id as key."""

    __slots__ = ("_stream",)

    def __init__(self) -> None:
        self._stream: Stream[Event] = Stream(MAX_ID, _reply)

    @property
    def held(self) -> int:
        """How many bytes wait for more."""
        return self._stream.held

    def feed(self, data: Data) -> list[Event]:
        """Take bytes, cut anywhere; give what is complete. Never raises."""
        if isinstance(data, CanFrame):
            return [Noise(data.data, "foreign")]
        return self._stream.feed(data)

    def flush(self) -> list[Event]:
        """Nothing more comes: give what can be made of the rest."""
        return self._stream.flush()


def _behind(data: bytes, start: int) -> int:
    """Where to look on behind a header whose id is none: of many FF in a row only the last two can begin a packet."""
    if data[start + 2] != HEADER[0]:
        return start + 1
    while piece := data[start : start + MAX_LENGTH]:
        left = piece.lstrip(HEADER)
        start += len(piece) - len(left)
        if left:
            break
    return start - len(HEADER)


def _status(data: bytes) -> Packet:
    return StatusPacket(data[2], data[4], data[5:-1], data)


def _instruction(data: bytes) -> Packet:
    return InstructionPacket(data[2], data[4], data[5:-1], data)


def _reply(data: bytes) -> Event:
    return Reply(0, data[2], data)
