"""Select the packets among all candidates in a recording, with numpy arrays.

Rules of every family on a byte stream: the first valid packet takes its bytes, the search continues after it, and bytes
between packets are noise. numpy is an argument (`np`), so that importing this module does not load it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from motorbus.core.capture import ABSENT, FAULTS, NOISE, PIECE, Columns

Spans: TypeAlias = tuple[Any, Any]
"""Arrays of starts and ends."""

_CHECKSUM = FAULTS.index("checksum")
_FRAMING = FAULTS.index("framing")
_MANY = 64
"""numpy copies the spans of one size together if they are more than this number plus 1/64 of all spans; fewer are
faster to copy one by one."""


def first_come(np: Any, starts: Any, ends: Any) -> Any:
    """Mask of the spans (sorted by start) that are accepted: those that begin outside every accepted span."""
    taken = np.ones(len(starts), bool)
    meets = np.flatnonzero(starts[1:] < ends[:-1])  # overlaps are rare
    at = 0
    while at < len(meets):
        one = int(meets[at])
        behind = int(np.searchsorted(starts, ends[one]))
        taken[one + 1 : behind] = False
        at = int(np.searchsorted(meets, behind))
    return taken


def tiled(
    np: Any, total: int, sound: Spans, doubtful: Spans, tell: Callable[[Any, Any], tuple[Any, Any, Any]]
) -> Columns:
    """Divide `total` bytes into packets and noise.

    `sound` are valid packets, sorted by start, `doubtful` packets with a wrong checksum. A valid packet that ends after
    the last byte makes the remaining bytes noise. `tell(starts, ends)` gives kinds, nodes and codes of packets; a
    single number where all packets have the same.
    """
    starts, ends = sound
    taken = first_come(np, starts, ends)
    if not taken.all():
        which = np.flatnonzero(taken)  # indexing by positions is faster than by a mask
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
    np: Any, total: int, packets: Any, facts: tuple[Any, Any, Any], begin: Any, fault: Any
) -> Columns:
    """Merge packets and noise in order. There are no gaps, so each ends where the next begins."""
    order = np.argsort(begin, kind="stable")  # two sorted runs: the fastest case of this sort
    begin = begin[order]
    stray = np.searchsorted(packets, begin) + np.arange(len(begin))
    sound = np.ones(len(packets) + len(begin), bool)
    sound[stray] = False
    where = np.flatnonzero(sound)
    columns = Columns(*np.empty((len(Columns._fields), len(sound)), np.int64))  # a single allocation
    for column, those, others in zip(
        (columns.start, columns.kind, columns.node, columns.code, columns.fault),
        (packets, *facts, 0),
        (begin, NOISE, ABSENT, ABSENT, fault[order]),
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


def _between(np: Any, starts: Any, ends: Any, total: int) -> Spans:
    """The gaps between these spans, which do not overlap, within `total` bytes."""
    inner = np.flatnonzero(ends[:-1] < starts[1:])
    begin = np.concatenate(([0], ends[inner], ends[-1:]))
    end = np.concatenate((starts[:1], starts[inner + 1], [total]))
    wide = begin < end
    return begin[wide], end[wide]


def _united(np: Any, gaps: Spans, starts: Any, ends: Any, behind: int) -> Spans:
    """Spans with a wrong checksum, each up to the next packet: starts and ends of disjoint spans.

    A doubtful span outside the gaps, or from `behind` on, lies in a packet and is not counted.
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


def _without(np: Any, gaps: Spans, bad: Spans) -> Spans:
    """The gaps without the bad spans; a gap may contain several."""
    begin = np.sort(np.concatenate((gaps[0], bad[1])))
    end = np.sort(np.concatenate((bad[0], gaps[1])))
    wide = begin < end
    return begin[wide], end[wide]


def _pieces(np: Any, starts: Any, ends: Any, fault: int) -> tuple[Any, Any]:
    """Starts and faults of these spans, split into pieces of at most `PIECE` bytes."""
    count = -((starts - ends) // PIECE)
    if (count > 1).any():
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        starts = np.repeat(starts, count) + number * PIECE
    return starts, np.full(len(starts), fault, np.int8)


def cut_out(np: Any, data: bytes, starts: Any, sizes: Any) -> list[bytes]:
    """The bytes of these spans: with numpy for a size that many spans have, else one by one."""
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
