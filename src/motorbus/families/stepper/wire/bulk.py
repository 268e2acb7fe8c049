"""All frames of a whole recording at once: the rules of `recording` as arithmetic on arrays.

What is found, frames and noise, is what a `recording.Recording` finds that is fed the same. numpy comes as an argument,
so that nothing is loaded with this file.
"""

from __future__ import annotations

from typing import Any

from motorbus.core.capture import NOTICE, REPLY, REQUEST, Columns
from motorbus.core.spans import tiled
from motorbus.families.stepper.wire import frames
from motorbus.families.stepper.wire.frames import (
    DUMP,
    DUMP_LENGTH,
    HEADER,
    ONLY,
    REPLY_LENGTH,
    REQUEST_LENGTH,
    reply_fault,
)


def frames_in(np: Any, data: bytes, way: str = "") -> Columns:
    """Everything in `data`, of the controller ("rx"), of a host ("tx"), or of both ("")."""
    line = np.frombuffer(data, np.uint8)
    starts = np.flatnonzero(_pair(line, HEADER) | _pair(line, frames.NOTICE))
    heads = np.append(line, np.zeros(REQUEST_LENGTH, np.uint8))[starts[:, None] + np.arange(REQUEST_LENGTH)]
    size, kind, doubt = _beginnings(np, heads, len(line) - starts, way)
    found, doubtful = size > 0, doubt > 0
    kinds = np.zeros(len(line), np.int8)
    kinds[starts[found]] = kind[found]

    def tell(starts: Any, ends: Any) -> tuple[Any, Any, Any]:
        first = np.where(kinds[starts] == NOTICE, starts, starts + 2)
        code = line[first].astype(np.int64) << 8 | line[first + 1]
        return kinds[starts], np.full(len(starts), ONLY), code

    sound = starts[found], (starts + size)[found]
    return tiled(np, len(line), sound, (starts[doubtful], (starts + doubt)[doubtful]), tell)


def _pair(line: Any, pair: bytes) -> Any:
    """Where these two bytes stand."""
    return (line[:-1] == pair[0]) & (line[1:] == pair[1])


def _beginnings(np: Any, heads: Any, have: Any, way: str) -> tuple[Any, Any, Any]:
    """Size, kind and doubtful bytes of each, as `recording.beginning` says."""
    notice = heads[:, 0] == frames.NOTICE[0]
    whole = ~notice & (have >= REQUEST_LENGTH)
    request = whole & (heads[:, :-1].sum(1) & 0xFF == heads[:, -1]) & (way != "rx")
    reply = ~notice & (have >= REPLY_LENGTH) & ~request & (way != "tx")
    reply[reply] = _can_be_replies(np, heads[reply])
    dump = reply & (heads[:, 2] == DUMP.code)
    damaged = whole & ~request & ~dump & (way != "rx")
    if not way:
        damaged &= ~_begin_in(heads[:, REPLY_LENGTH:])
    reply &= ~damaged
    notice &= way != "tx"
    size = 2 * notice + REQUEST_LENGTH * request + REPLY_LENGTH * reply + (DUMP_LENGTH - REPLY_LENGTH) * dump
    return size, NOTICE * notice + REQUEST * request + REPLY * reply, REQUEST_LENGTH * damaged


def _can_be_replies(np: Any, heads: Any) -> Any:
    """Each different one is asked for once."""
    different, which = np.unique(heads[:, :REPLY_LENGTH], axis=0, return_inverse=True)
    verdicts = [not reply_fault(head.tobytes()) for head in different]
    return np.array(verdicts, bool)[which.reshape(-1)]


def _begin_in(rows: Any) -> Any:
    """Whether something may begin in each of these."""
    begins = (rows[:, -1] == HEADER[0]) | (rows[:, -1] == frames.NOTICE[0])
    for pair in (HEADER, frames.NOTICE):
        begins |= ((rows[:, :-1] == pair[0]) & (rows[:, 1:] == pair[1])).any(1)
    return begins
