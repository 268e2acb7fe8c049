"""Packets as a sequence and as columns. What fills them is judged with the decoders."""

from __future__ import annotations

import pytest

from motorbus.core.capture import Packet
from motorbus.recorder.packets import Heard, Mark

ROWS = [
    Packet(10, b"ab", "reply", 1, 7, "", 0.5),
    Packet(12, b"cde", "noise", -1, -1, "framing", 0.5),
    Packet(25, b"f", "notice", 2, 8, "", 1.5),
    Packet(26, b"g", "noise", -1, -1, "checksum", 1.5),
]


def heard() -> Heard:
    marks = [Mark(0, 5, 0.5), Mark(10, 15, 1.5)]
    data = [row.data for row in ROWS]
    return Heard(5, marks, data, {1: 2, 3: 1}, lambda: ([2, 4], b"\x01\x02", [7, 8]), frames=False)


def test_rows_and_columns_are_the_same() -> None:
    packets = heard()
    assert list(packets) == ROWS
    assert [packets[index] for index in range(4)] == ROWS
    assert packets[-1] == ROWS[-1]
    assert packets[1:3] == ROWS[1:3]
    assert packets[::-2] == ROWS[::-2]
    assert list(packets.start) == [row.start for row in ROWS]
    assert packets.at == [row.at for row in ROWS]
    assert packets.size == [2, 3, 1, 1]


def test_it_is_a_sequence() -> None:
    packets = heard()
    assert len(packets) == 4
    assert ROWS[2] in packets
    assert packets.index(ROWS[2]) == 2
    assert list(reversed(packets)) == ROWS[::-1]
    for index in (4, -5):
        with pytest.raises(IndexError):
            _ = packets[index]


def test_frames_count_as_one_each() -> None:
    packets = Heard(3, [Mark(0, 0, None)], [b"abc", b"d"], {}, lambda: ([1, 2], [5, 6], [0, 0]), frames=True)
    assert list(packets.start) == [3, 4]
    assert packets.at is None
    assert packets[1:] == [Packet(4, b"d", "reply", 6, 0, "", None)]


def test_nothing_is_worked_out_before_it_is_asked_for() -> None:
    def never() -> tuple[list[int], list[int], list[int]]:
        raise AssertionError

    packets = Heard(0, [Mark(0, 0, None)], [b"abc"], {}, never, frames=False)
    assert (len(packets), packets.data, packets.fault) == (1, [b"abc"], [0])
