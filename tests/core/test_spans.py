"""Of spans of bytes that overlap the first one wins; the bytes between are noise."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.capture import FAULTS, PIECE
from motorbus.core.spans import cut_out, first_come, tiled

Tile: TypeAlias = tuple[int, int, str]
SPANS = st.lists(
    st.tuples(st.integers(0, 60), st.integers(1, 20)), max_size=12, unique_by=lambda span: span[0]
)


def walked(spans: list[tuple[int, int]]) -> list[bool]:
    """The same, one after the other."""
    position, taken = 0, []
    for start, size in spans:
        taken.append(start >= position)
        position = start + size if taken[-1] else position
    return taken


@given(spans=SPANS.map(sorted))
def test_each_is_taken_that_begins_where_none_is_under_way(spans: list[tuple[int, int]]) -> None:
    starts = np.array([start for start, _ in spans], int)
    ends = starts + np.array([size for _, size in spans], int)
    assert first_come(np, starts, ends).tolist() == walked(spans)


def tiles(total: int, sound: list[tuple[int, int]], doubtful: list[tuple[int, int]]) -> list[Tile]:
    """(start, size, fault) of everything."""
    columns = [[np.array(column, int) for column in zip(*spans, strict=True)] or [np.zeros(0, int)] * 2
               for spans in (sound, doubtful)]  # fmt: skip
    found = tiled(
        np,
        total,
        (columns[0][0], columns[0][1]),
        (columns[1][0], columns[1][1]),
        lambda starts, ends: (starts * 0 + 2, starts, ends),
    )
    faults = [FAULTS[number] for number in found.fault.tolist()]
    assert [node for node, fault in zip(found.node.tolist(), faults, strict=True) if fault] == [-1] * sum(
        map(bool, faults)
    )
    return list(zip(found.start.tolist(), found.size.tolist(), faults, strict=True))


@pytest.mark.parametrize(
    ("doubtful", "expected"),
    [
        ([(2, 6)], [(0, 2, "framing"), (2, 4, "checksum"), (6, 4, "framing"), (10, 5, "")]),
        ([(2, 6), (4, 9)], [(0, 2, "framing"), (2, 7, "checksum"), (9, 1, "framing"), (10, 5, "")]),
        ([(2, 9), (4, 6)], [(0, 2, "framing"), (2, 7, "checksum"), (9, 1, "framing"), (10, 5, "")]),
        ([(2, 4), (4, 6)], [(0, 2, "framing"), (2, 4, "checksum"), (6, 4, "framing"), (10, 5, "")]),
        ([(2, 4), (5, 6)], [(0, 2, "framing"), (2, 2, "checksum"), (4, 1, "framing"), (5, 1, "checksum"),
                            (6, 4, "framing"), (10, 5, "")]),
        ([(8, 14)], [(0, 8, "framing"), (8, 2, "checksum"), (10, 5, "")]),
        ([(11, 13)], [(0, 10, "framing"), (10, 5, "")]),
    ],
)  # fmt: skip
def test_doubt_ends_at_the_next_packet_and_never_begins_in_one(
    doubtful: list[tuple[int, int]], expected: list[Tile]
) -> None:
    assert tiles(15, [(10, 15)], doubtful) == expected


@pytest.mark.parametrize("extra", [-1, 0, 1, PIECE])
def test_a_long_run_of_noise_comes_in_pieces(extra: int) -> None:
    total = 2 * PIECE + extra
    sizes = [size for _, size, _ in tiles(total + 3, [(total, total + 3)], [])]
    assert sizes[-1] == 3
    assert sum(sizes[:-1]) == total
    assert set(sizes[:-2]) == {PIECE}
    assert 0 < sizes[-2] <= PIECE


@given(sizes=st.lists(st.sampled_from([1, 2, 3, 8, 8, 8, 21, 46]), max_size=9), times=st.integers(0, 90))
def test_bytes_are_cut_out_as_by_slices(sizes: list[int], times: int) -> None:
    """Those at the very end as well, and with zeros at their ends."""
    many = np.array(sizes * times, int)
    starts = np.cumsum(many) - many
    data = bytes(place % 7 % 3 for place in range(int(many.sum())))
    cut = cut_out(np, data, starts, many)
    assert cut == [data[at : at + size] for at, size in zip(starts.tolist(), many.tolist(), strict=True)]
    assert {type(one) for one in cut} <= {bytes}
    assert type(cut) is list
