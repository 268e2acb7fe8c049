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
_MANY = 64
"""Spans of one size, or parts of all spans: for fewer it takes longer to look for them than to cut them out."""


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
    nodes and codes of packets by starts and ends; one number where all have the same.
    """
    starts, ends = sound
    taken = first_come(np, starts, ends)
    if not taken.all():
        which = np.flatnonzero(taken)  # taking by places is quicker than by a mask
        starts, ends = starts[which], ends[which]
    behind = total
    if len(ends) and ends[-1] > total:
        behind = starts[-1]
        starts, ends = starts[:-1], ends[:-1]
    gaps = _between(np, starts, ends, total)
    bad = _united(np, gaps, *doubtful, behind)
    noise = [_pieces(np, *bad, _CHECKSUM), _pieces(np, *_without(np, gaps, bad), _FRAMING)]
    stray = [np.concatenate(column) for column in zip(*noise, strict=True)]
    return _columns(np, total, starts, tell(starts, ends), *stray)


def _columns(
    np: Any, total: int, packets: Any, told: tuple[Any, Any, Any], begin: Any, fault: Any
) -> Columns:
    """All in order. As there is nothing between them, each ends where the next one begins."""
    order = np.argsort(begin, kind="stable")  # two rows in order: the quickest sort of all
    begin = begin[order]
    stray = np.searchsorted(packets, begin) + np.arange(len(begin))
    sound = np.ones(len(packets) + len(begin), bool)
    sound[stray] = False
    where = np.flatnonzero(sound)
    columns = Columns(*np.empty((len(Columns._fields), len(sound)), np.int64))  # one block is got at one go
    for column, those, others in zip(
        (columns.start, columns.kind, columns.node, columns.code, columns.fault),
        (packets, *told, 0),
        (begin, NOISE, NOBODY, NOBODY, fault[order]),
        strict=True,
    ):
        if np.ndim(those):
            column[where] = those
        else:
            column.fill(those)
        column[stray] = others
    np.subtract(columns.start[1:], columns.start[:-1], out=columns.size[:-1])
    columns.size[-1:] = total - columns.start[-1:]
    return columns


def _between(np: Any, starts: Any, ends: Any, total: int) -> tuple[Any, Any]:
    """The gaps of these spans, of which none overlap, within `total`."""
    inner = np.flatnonzero(ends[:-1] < starts[1:])
    begin = np.concatenate(([0], ends[inner], ends[-1:]))
    end = np.concatenate((starts[:1], starts[inner + 1], [total]))
    wide = begin < end
    return begin[wide], end[wide]


def _united(np: Any, gaps: tuple[Any, Any], starts: Any, ends: Any, behind: int) -> tuple[Any, Any]:
    """What wrong checksums cast doubt on, each up to the next packet: starts and ends that do not touch.

    A doubtful place outside the gaps, or from `behind` on, is in a packet and was never looked at.
    """
    begin, end = gaps
    if not len(starts) or not len(begin):
        return starts[:0], ends[:0]
    gap = np.searchsorted(begin, starts, "right") - 1
    free = (gap >= 0) & (starts < np.minimum(end[gap], behind))
    if not free.any():
        return starts[:0], ends[:0]
    starts, border = starts[free], end[gap[free]]
    furthest = np.maximum.accumulate(np.minimum(np.minimum(ends[free], border), behind))
    opens = np.ones(len(starts), bool)
    opens[1:] = starts[1:] > furthest[:-1]
    first = np.flatnonzero(opens)
    return starts[first], furthest[np.append(first[1:], len(starts)) - 1]


def _without(np: Any, gaps: tuple[Any, Any], bad: tuple[Any, Any]) -> tuple[Any, Any]:
    """What is left of the gaps, each of which may hold several of the others: it ends where one of those begins."""
    begin = np.sort(np.concatenate((gaps[0], bad[1])))
    end = np.sort(np.concatenate((bad[0], gaps[1])))
    wide = begin < end
    return begin[wide], end[wide]


def _pieces(np: Any, starts: Any, ends: Any, fault: int) -> tuple[Any, Any]:
    """Where these spans begin, cut so that none is longer than `PIECE`, and what they are."""
    count = -((starts - ends) // PIECE)
    if (count > 1).any():
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        starts = np.repeat(starts, count) + number * PIECE
    return starts, np.full(len(starts), fault, np.int8)


def cut_out(np: Any, data: bytes, starts: Any, sizes: Any) -> list[bytes]:
    """The bytes of these spans.

    Those of a size that many have are made by numpy, all of this size at once, and only the rest one by one.
    """
    found = np.empty(len(starts), object)
    count = np.bincount(sizes)
    many = count > _MANY + len(starts) // _MANY
    for size in np.flatnonzero(many).tolist():
        alike = np.flatnonzero(sizes == size)
        found[alike] = np.ndarray(len(data) - size + 1, f"V{size}", data, strides=1)[starts[alike]]
    others = np.flatnonzero(~many[sizes])
    begin, end = starts[others], starts[others] + sizes[others]
    for place, start, stop in zip(others.tolist(), begin.tolist(), end.tolist(), strict=True):
        found[place] = data[start:stop]
    cut: list[bytes] = found.tolist()
    return cut
