"""All packets of a whole recording at once: the rules of `stream` as arithmetic on arrays.

Sums of all bytes up to some place make every checksum one subtraction. What is found, packets and noise, is what a
`recording.Recording` finds that is fed the same. numpy comes as an argument, so that nothing is loaded with this file.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from motorbus.core.capture import REPLY, REQUEST, Columns
from motorbus.core.spans import tiled
from motorbus.families.feetech.wire.packets import (
    BROADCAST,
    HEADER,
    MAX_ID,
    OVERHEAD,
    SOUND,
)
from motorbus.families.feetech.wire.sides import CODE, ID, LENGTH, Sides, may_ask


def packets(np: Any, data: bytes, way: str = "") -> Columns:
    """Everything in `data`, of servos ("rx"), of a host ("tx"), or of both ("")."""
    line = np.frombuffer(data, np.uint8)

    def tell(starts: Any, ends: Any) -> tuple[Any, Any, Any]:
        ids, codes = line[ID:][starts], line[CODE:][starts]
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
    ids, lengths = line[ID:][starts], line[LENGTH:][starts]
    ends = starts + lengths
    ends += 4
    form = (ids <= top) & (lengths >= 2) & (ends <= len(line))
    good = form & (_sums(np, line, starts, ends, form) == SOUND)
    if good.all():
        return (starts, ends), (starts[:0], ends[:0])
    sound, doubtful = np.flatnonzero(good), np.flatnonzero(form & ~good)
    return (starts[sound], ends[sound]), (starts[doubtful], ends[doubtful])


def _headers(np: Any, line: Any) -> Any:
    """Where a header is that has room for a packet behind it."""
    full = line == HEADER[0]
    full[:-1] &= full[1:]
    full[-1:] = False
    starts = np.flatnonzero(full)
    return starts[: np.searchsorted(starts, len(line) - OVERHEAD, "right")]


def _sums(np: Any, line: Any, starts: Any, ends: Any, form: Any) -> Any:
    """The low bytes of the sums of those spans that have the form: most of them end where the next one begins."""
    sums = np.add.reduceat(line, starts, dtype=np.uint8)
    apart = np.flatnonzero(form & (ends != np.append(starts[1:], -1)))
    stops = np.minimum(ends[apart], len(line) - 1)
    edges = np.stack((starts[apart], stops), axis=1).reshape(-1)
    last = (ends[apart] > stops) * line[-1:]  # of nothing there is no last one
    sums[apart] = np.add.reduceat(line, edges, dtype=np.uint8)[::2] + last
    return sums


def _kinds(np: Any, data: bytes, starts: Any, ends: Any, ids: Any, codes: Any, way: str) -> Any:
    if way or not may_ask(ids.tobytes(), codes.tobytes()):
        return REQUEST if way == "tx" else REPLY
    each = [data[start:end] for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]
    return np.array(Sides().tell(each)()[0], np.int8)
