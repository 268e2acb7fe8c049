"""All packets of a whole recording at once: the rules of `stream` as arithmetic on arrays.

Sums of all bytes up to some place make every checksum one subtraction. What is found, packets and noise, is what a
`recording.Recording` finds that is fed the same. numpy comes as an argument, so that nothing is loaded with this file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from motorbus.core.capture import REPLY, REQUEST, Columns
from motorbus.core.spans import tiled
from motorbus.families.feetech.wire.packets import (
    BROADCAST,
    HEADER,
    MAX_ID,
    MAX_LENGTH,
    OVERHEAD,
    SOUND,
)
from motorbus.families.feetech.wire.sides import CODE, ID, LENGTH, Sides, may_ask


def packets(np: Any, data: bytes, way: str = "") -> Columns:
    """Everything in `data`, of servos ("rx"), of a host ("tx"), or of both ("")."""
    line = np.frombuffer(data, np.uint8)

    def tell(starts: Any, ends: Any) -> tuple[Any, Any, Any]:
        ids, codes = line[starts + ID], line[starts + CODE]
        return _kinds(np, data, starts, ends, ids, codes, way), ids, codes

    return tiled(np, len(data), *_places(np, line, top(way)), tell)


def top(way: str) -> int:
    """The greatest id of packets that went this way."""
    return MAX_ID if way == "rx" else BROADCAST


Spans: TypeAlias = tuple[Any, Any]
"""Starts and ends."""


def _places(np: Any, line: Any, top: int) -> tuple[Spans, Spans]:
    """All that has the form of a packet and is there as a whole: where the checksum is right, and where it is wrong."""
    starts = _headers(np, line)
    ids, lengths = line[starts + ID], line[starts + LENGTH]
    ends = starts + lengths + 4
    form = (ids <= top) & (lengths >= 2) & (ends <= len(line))
    sums = _sums(np, line)
    good = form & (sums(ends) - sums(starts) == SOUND)
    if good.all():
        return (starts, ends), (starts[:0], ends[:0])
    sound, doubtful = np.flatnonzero(good), np.flatnonzero(form & ~good)
    return (starts[sound], ends[sound]), (starts[doubtful], ends[doubtful])


def _headers(np: Any, line: Any) -> Any:
    """Where a header is that has room for a packet behind it."""
    full = line == HEADER[0]
    starts = np.flatnonzero(full[:-1] & full[1:])
    return starts[: np.searchsorted(starts, len(line) - OVERHEAD, "right")]


def _sums(np: Any, line: Any) -> Callable[[Any], Any]:
    """A function: the low bytes of the sums of all bytes before these places, up to a packet behind the last byte.

    Eight bytes are summed at once, as four numbers of 16 bits side by side in one of 64, and only these sums are added
    up over the whole line.
    """
    words = np.append(line, np.zeros(MAX_LENGTH + 17 - len(line) % 8, np.uint8)).view("<u8")
    lanes, ones, eight, high = map(np.uint64, (0x00FF_00FF_00FF_00FF, 0x0001_0001_0001_0001, 8, 48))
    first = np.array([(1 << 8 * count) - 1 for count in range(8)], np.uint64)

    def within(words: Any) -> Any:
        pairs = (words & lanes) + (words >> eight & lanes)
        return (pairs * ones >> high).astype(np.uint8)

    before = np.zeros(len(words), np.uint8)
    np.cumsum(within(words[:-1]), dtype=np.uint8, out=before[1:])

    def sums(places: Any) -> Any:
        which = places >> 3
        return before[which] + within(words[which] & first[places & 7])

    return sums


def _kinds(np: Any, data: bytes, starts: Any, ends: Any, ids: Any, codes: Any, way: str) -> Any:
    if way or not may_ask(ids.tobytes(), codes.tobytes()):
        return np.full(len(starts), REQUEST if way == "tx" else REPLY, np.int8)
    each = [data[start:end] for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]
    return np.array(Sides().tell(each)()[0], np.int8)
