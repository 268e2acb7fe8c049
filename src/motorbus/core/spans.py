"""Which of many places in a recording are packets, worked out for all of them at once.

Rules of every family with bytes: the first place that holds a sound packet takes its bytes, the next one is looked for
behind it, and what lies between is noise. numpy comes as an argument, so that nothing is loaded with this file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorbus.core.capture import FAULTS, NOBODY, NOISE, PIECE, Columns

_CHECKSUM = FAULTS.index("checksum")
_FRAMING = FAULTS.index("framing")


def first_come(np: Any, starts: Any, ends: Any) -> Any:
    """Which of these spans (sorted by their starts) are taken, as a mask: each that begins where none is under way."""
    taken = np.ones(len(starts), bool)
    meets = np.flatnonzero(starts[1:] < ends[:-1])  # rarely any
    at = 0
    while at < len(meets):
        one = int(meets[at])
        behind = int(np.searchsorted(starts, ends[one]))
        taken[one + 1 : behind] = False
        at = int(np.searchsorted(meets, behind))
    return taken


def tiled(
    np: Any,
    total: int,
    sound: tuple[Any, Any],
    doubtful: tuple[Any, Any],
    tell: Callable[[Any, Any], tuple[Any, Any, Any]],
) -> Columns:
    """Packets and noise that together are all of `total` bytes.

    `sound` and `doubtful` are starts (sorted) and ends of places where a packet is, and where one seems to be but for
    its checksum. A sound one that ends behind the last byte takes the rest and makes it noise. `tell` gives kinds,
    nodes and codes of packets by starts and ends.
    """
    starts, ends = sound
    taken = first_come(np, starts, ends)
    if not taken.all():
        starts, ends = starts[taken], ends[taken]
    bad = _united(np, (starts, ends), *doubtful, total)
    if len(ends) and ends[-1] > total:
        starts, ends = starts[:-1], ends[:-1]
    rest = _between(np, *_merged(np, starts, ends, *bad), total)
    noise = [_pieces(np, *bad, _CHECKSUM), _pieces(np, *rest, _FRAMING)]
    stray = [np.concatenate(column) for column in zip(*noise, strict=True)]
    return _columns(np, starts, ends, tell(starts, ends), *stray)


def _columns(
    np: Any, starts: Any, ends: Any, told: tuple[Any, Any, Any], begin: Any, end: Any, fault: Any
) -> Columns:
    if not len(begin):
        kind, node, code = (column.astype(np.int64) for column in told)
        return Columns(starts, ends - starts, kind, node, code, np.zeros(len(starts), np.int64))
    order = np.argsort(begin)
    stray = np.searchsorted(starts, begin[order]) + np.arange(len(begin))
    sound = np.ones(len(starts) + len(begin), bool)
    sound[stray] = False

    def among(packets: Any, noise: Any) -> Any:
        column = np.empty(len(sound), np.int64)
        column[sound], column[stray] = packets, noise
        return column

    return Columns(
        among(starts, begin[order]),
        among(ends - starts, (end - begin)[order]),
        among(told[0], NOISE),
        among(told[1], NOBODY),
        among(told[2], NOBODY),
        among(0, fault[order]),
    )


def _united(np: Any, taken: tuple[Any, Any], starts: Any, ends: Any, total: int) -> tuple[Any, Any]:
    """What wrong checksums cast doubt on, each up to the next packet: starts and ends that do not touch.

    A doubtful place inside a packet was never looked at.
    """
    if len(starts) and len(taken[0]):
        before = np.searchsorted(taken[0], starts, "right") - 1
        free = (before < 0) | (starts >= taken[1][before])
        starts, ends = starts[free], ends[free]
    if not len(starts):
        return starts, ends
    borders = np.append(taken[0], total)
    furthest = np.maximum.accumulate(np.minimum(ends, borders[np.searchsorted(borders, starts)]))
    opens = np.ones(len(starts), bool)
    opens[1:] = starts[1:] > furthest[:-1]
    first = np.flatnonzero(opens)
    return starts[first], furthest[np.append(first[1:], len(starts)) - 1]


def _merged(np: Any, starts: Any, ends: Any, more: Any, until: Any) -> tuple[Any, Any]:
    if not len(more):
        return starts, ends
    every = np.concatenate((starts, more))
    order = np.argsort(every, kind="stable")
    return every[order], np.concatenate((ends, until))[order]


def _between(np: Any, starts: Any, ends: Any, total: int) -> tuple[Any, Any]:
    """The gaps of these spans, of which none overlap, within `total`."""
    begin, end = np.append(0, ends), np.append(starts, total)
    wide = begin < end
    return begin[wide], end[wide]


def _pieces(np: Any, starts: Any, ends: Any, fault: int) -> tuple[Any, Any, Any]:
    """These spans cut so that none is longer than `PIECE`."""
    count = -((starts - ends) // PIECE)
    if (count > 1).any():
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        starts, ends = np.repeat(starts, count) + number * PIECE, np.repeat(ends, count)
        ends = np.minimum(starts + PIECE, ends)
    return starts, ends, np.full(len(starts), fault, np.int8)
