"""What was recorded of a controller's line, both ways in one stream or one way by itself.

Requests and replies begin alike, and a reply has no checksum, so the order of the questions decides: eleven bytes with
a right checksum are a request; what begins a dump is one; eleven bytes with a wrong one are a damaged request if
nothing else begins in the last five of them; else six bytes that a reply can be are one. What is nothing of all that
is given up by one byte. What has begun and is not whole at the end is noise and not searched: a dump may hold anything.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import NOISE, NOTICE, REPLY, REQUEST, Captures, PacketFacts, Run
from motorbus.core.request import Data, Noise
from motorbus.families.stepper.wire import bulk, frames
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


class Beginning(NamedTuple):
    """So many bytes of this kind begin here; or none do, and so many are a request but for the checksum."""

    size: int
    kind: int
    doubt: int = 0


_NOTHING: Final = Beginning(0, NOISE)
_DAMAGED: Final = Beginning(0, NOISE, REQUEST_LENGTH)


def beginning(head: bytes, way: str) -> Beginning:
    """What these bytes, eleven unless the recording ends before, begin."""
    if head[:2] == frames.NOTICE:
        return _NOTHING if way == "tx" else Beginning(2, NOTICE)
    if head[:2] != HEADER:
        return _NOTHING
    if way != "rx" and is_sound(head):
        return Beginning(REQUEST_LENGTH, REQUEST)
    reply = way != "tx" and len(head) >= REPLY_LENGTH and not reply_fault(head)
    if reply and head[2] == DUMP.code:
        return Beginning(DUMP_LENGTH, REPLY)
    if way != "rx" and len(head) == REQUEST_LENGTH and (way or not _begins_in(head[REPLY_LENGTH:])):
        return _DAMAGED
    return Beginning(REPLY_LENGTH, REPLY) if reply else _NOTHING


def _begins_in(data: bytes) -> bool:
    return HEADER in data or frames.NOTICE in data or data[-1] in _STARTS


class Recording:
    """Frames of the controller ("rx"), of a host ("tx"), or of both (""); see `core.capture.Cutter`."""

    __slots__ = ("_doubt", "_kinds", "_rest", "_way")

    def __init__(self, way: str = "") -> None:
        self._way = way
        self._rest = b""
        self._doubt = 0  # so many bytes of the rest belong to a request whose checksum was wrong
        self._kinds: list[int] = []

    def feed(self, data: Data) -> list[Run]:
        """Take bytes, cut anywhere; give what is complete. A pause between them is not looked at."""
        if isinstance(data, CanFrame):
            return [Noise(data.data, "foreign")]
        return self._cut(self._rest + data, more=True)

    def flush(self) -> list[Run]:
        """Nothing more comes: give what can be made of the rest."""
        return self._cut(self._rest, more=False)

    def tell(self, packets: list[bytes]) -> PacketFacts:
        """Kinds, the one node of the line, and bytes 2 and 3 of the packets that were found next."""
        kinds, self._kinds = self._kinds[: len(packets)], self._kinds[len(packets) :]
        return lambda: (kinds, [ONLY] * len(packets), [code_of(packet) for packet in packets])

    def _cut(self, data: bytes, more: bool) -> list[Run]:
        runs: list[Run] = []
        position = 0
        while position < len(data):
            head = data[position : position + REQUEST_LENGTH]
            if more and self._waits(head):
                break
            size, kind, doubt = beginning(head, self._way)
            if position + size > len(data) and more:
                break
            if size:
                self._doubt, found = 0, data[position : position + size]
                runs.append(self._taken(found, kind) if len(found) == size else Noise(found, "framing"))
            else:
                size = _next(data, position + 1) - position
                self._doubt = max(self._doubt, doubt)
                self._told(runs, data[position : position + size])
            position += size
        self._rest = data[position:]
        return runs

    def _taken(self, packet: bytes, kind: int) -> list[bytes]:
        self._kinds.append(kind)
        return [packet]

    def _told(self, runs: list[Run], noise: bytes) -> None:
        bad, stray = noise[: self._doubt], noise[self._doubt :]
        if bad:
            runs.append(Noise(bad, "checksum"))
        if stray:
            runs.append(Noise(stray, "framing"))
        self._doubt -= len(bad)

    def _waits(self, head: bytes) -> bool:
        """Can what begins here only be told by bytes that have not come?"""
        if len(head) < 2:
            return head[0] in _STARTS
        due = REPLY_LENGTH if self._way == "rx" else REQUEST_LENGTH
        return head[:2] == HEADER and len(head) < due


def code_of(packet: bytes) -> int:
    """Bytes 2 and 3, which tell the command; EE DD of the notice."""
    return int.from_bytes(packet[2:4] or packet, "big")


def _next(data: bytes, start: int) -> int:
    """Where something may begin from here on."""
    places = (data.find(byte, start) for byte in _STARTS)
    return min((place for place in places if place >= start), default=len(data))


CAPTURES: Final = Captures(
    Recording,
    bulk.frames_in,
    "bytes 2 and 3 of a request or a reply, which tell the command; EE DD of the notice",
)
