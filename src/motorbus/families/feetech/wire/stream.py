"""Packets out of a stream of bytes that may be cut anywhere, begin anywhere, and be wrong anywhere.

There is no byte stuffing, so FF FF proves nothing: a packet is one only when id, length and checksum agree.
Whatever fails is given up by ONE byte, never by the length it claimed, so that a good packet inside a bad one
is not lost. What may still become a packet waits (at most 258 bytes); `flush` says that nothing more comes.

Each byte ends in exactly one event. Noise is "checksum" for the bytes of a whole packet whose checksum is
wrong, else "framing". How the stream was cut changes neither packets nor these words, only whether a run of
noise comes in one piece.

Packets in a row are taken one by one where each is expected, and so is a packet with nothing wrong but its checksum in
which no other can begin; only elsewhere the search begins, which gives the same events.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Generic, Literal, TypeAlias, TypeVar
from zlib import adler32

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
Run: TypeAlias = "list[bytes] | Noise"
"""Whole packets in a row, or what lies between two of them."""
HEADLESS: Final = 65011
"""Where Adler-32 begins so that its low half is the sum without the header; that of a sound packet is never reduced."""
_SIZES: Final = (0, 0, *range(OVERHEAD, MAX_LENGTH + 5))
"""Bytes of a packet by its length field; 0 for none."""
_new: Final = tuple.__new__
"""Makes a `Noise` in a third of the time."""


class Stream(Generic[P]):
    """Finds packets with an id up to `top` and hands each whole one to `make`."""

    __slots__ = ("_above", "_make", "_rest", "_suspect", "_top")

    def __init__(self, top: int, make: Callable[[bytes], P]) -> None:
        self._top = top
        self._above = HEADER + bytes((top + 1,))
        self._make = make
        self._rest = b""
        self._suspect = 0  # so many bytes of the rest belong to a packet whose checksum was wrong

    @property
    def held(self) -> int:
        """How many bytes wait for more."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[P | Noise]:
        """Take bytes; give what is complete. Good packets in a row, the usual case, are not searched for."""
        if self._rest:
            data = self._rest + data
        events: list[P | Noise] = []
        if self._suspect:
            return self._made(self._hunt(data, more=True))
        start, end, make, top = 0, len(data), self._make, self._top
        while end - start >= OVERHEAD:
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
        return events + self._made(self._hunt(data[start:], more=True))

    def flush(self) -> list[P | Noise]:
        """Nothing more comes: look for packets behind each false start, and give the rest as noise."""
        return self._made(self.rest())

    def runs(self, data: bytes) -> list[Run]:
        """As `feed`, but packets as they are and all that follow one another in one list: for much at once."""
        if held := self._rest:
            data = held + data
            if len(held) > 3 and len(data) < held[3] + 4:
                self._rest = data
                return []
        return self._cut(data)

    def rest(self) -> list[Run]:
        """As `flush`, in runs."""
        return self._hunt(self._rest, more=False)

    def _made(self, runs: list[Run]) -> list[P | Noise]:
        events: list[P | Noise] = []
        for run in runs:
            if isinstance(run, Noise):
                events.append(run)
            else:
                events += map(self._make, run)
        return events

    def _cut(self, data: bytes) -> list[Run]:
        """All that is complete: what can be told where it is expected to begin, and the rest searched."""
        runs: list[Run] = []
        run: list[bytes] = []
        above, sizes, end = self._above, _SIZES, len(data)
        start, last = 0, end - 4
        if self._suspect and (start := self._search(data, 0, runs, more=True)) < 0:
            return runs
        while start <= last:
            stop = start + sizes[data[start + 3]]
            packet = data[start:stop]
            if adler32(packet, HEADLESS) & 0xFF == 0xFF and stop <= end and HEADER <= packet < above:
                run.append(packet)
                start = stop
                continue
            if run:
                runs.append(run)
                run = []
            if packet < HEADER:
                behind, fault = data.find(HEADER, start + 1), "framing"
            elif packet >= above:
                behind, fault = self._sound(data, data.find(HEADER, _behind(data, start))), "framing"
            elif stop > end:
                break
            else:
                behind, fault = self._inside(data, start, stop), "checksum"
            if behind > 0:
                runs.append(_new(Noise, (data[start:behind], fault, None)))
                start = behind
            elif (start := self._search(data, start, runs, more=True)) < 0:
                return runs
        if run:
            runs.append(run)
        rest = data[start:]
        if not rest or HEADER <= rest < above:
            self._rest = rest
        else:
            self._search(rest, 0, runs, more=True)
        return runs

    def _inside(self, data: bytes, start: int, stop: int) -> int:
        """Where to look on behind a header here whose checksum is wrong; -1 where only a search can tell."""
        place = data.find(HEADER, start + 2, stop + 1)
        if place < 0:
            return -1 if stop == len(data) and data[-1] == HEADER[0] else stop
        return self._sound(data, place)

    def _sound(self, data: bytes, place: int) -> int:
        """This place of a header if it holds a packet, and -1 if not, or not yet; also for -1."""
        size = _SIZES[data[place + 3]] if 0 <= place < len(data) - 3 else 0
        packet = data[place : place + size]
        return place if len(packet) == size > 0 and packet < self._above and is_sound(packet) else -1

    def _hunt(self, data: bytes, more: bool) -> list[Run]:
        """All of this searched."""
        runs: list[Run] = []
        position = 0
        while (start := self._search(data, position, runs, more)) >= 0:
            position = start + data[start + 3] + 4
            runs.append([data[start:position]])
        return runs

    def _search(self, data: bytes, position: int, runs: list[Run], more: bool) -> int:
        """Where the next packet begins, all before it told; -1 when there is none, what may become one kept."""
        noise = position  # what lies between the two is noise, not yet told
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
                self._tell(runs, data[noise:start])
                self._suspect = 0
                return start
            noise = self._doubt(runs, data, noise, start, size)
        else:
            position = end - 1 if more and position < end and data[-1] == 0xFF else end
        self._tell(runs, data[noise:position])
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

    def _doubt(self, runs: list[Run], data: bytes, noise: int, start: int, size: int) -> int:
        """A whole packet with a wrong checksum: from where on noise is not yet told."""
        if start - noise >= self._suspect:
            self._tell(runs, data[noise:start])
            noise = start
        self._suspect = max(self._suspect, start + size - noise)
        return noise

    def _tell(self, runs: list[Run], noise: bytes) -> None:
        bad, stray = noise[: self._suspect], noise[self._suspect :]
        if bad:
            runs.append(Noise(bad, "checksum"))
        if stray:
            runs.append(Noise(stray, "framing"))
        self._suspect -= len(bad)


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
