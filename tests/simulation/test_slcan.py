"""The slcan adapter line by line: its answers in each state, and what garbage cannot do to it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.simulation.slcan import MAX_LINE, RATES, SlcanAdapter

FRAMES = [
    (b"t62582203600084030000\r", CanFrame(0x625, bytes.fromhex("2203600084030000"))),
    (b"t7FF0\r", CanFrame(0x7FF, b"")),
    (b"T1FFFFFFF2ABCD\r", CanFrame(0x1FFFFFFF, bytes.fromhex("ABCD"), True)),
    (b"r1234\r", CanFrame(0x123 | REMOTE_FLAG, bytes(4))),
    (b"R000001238\r", CanFrame(0x123 | REMOTE_FLAG, bytes(8), True)),
]


def answer(adapter: SlcanAdapter, text: bytes) -> bytes:
    adapter.receive(text)
    return adapter.take_answer()


def opened() -> SlcanAdapter:
    adapter = SlcanAdapter()
    assert answer(adapter, b"S6\rO\r") == b"\r\r"
    return adapter


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        (b"", b"\r"),
        (b"V", b"V1013\r"),
        (b"F", b"F00\r"),
        (b"X1", b"\r"),
        (b"U0", b"\r"),
        (b"C", b"\r"),
        (b"\nV", b"V1013\r"),
        (b"S9", b"\a"),
        (b"S", b"\a"),
        (b"P", b"\a"),
        (b"?", b"\a"),
        (b"t6250", b"\a"),
        (b"x" * MAX_LINE * 9, b"\a"),
    ],
)
def test_the_answer_of_a_closed_channel(line: bytes, reply: bytes) -> None:
    assert answer(SlcanAdapter(), line + b"\r") == reply


@pytest.mark.parametrize(
    "line", [b"t6251", b"t625100FF", b"t6259", b"t8250", b"tXYZ0", b"T200000000", b"t62510G", b"r12311"]
)
def test_a_frame_that_is_refused(line: bytes) -> None:
    adapter = opened()
    assert adapter.receive(line + b"\r") == []
    assert adapter.take_answer() == b"\a"


@pytest.mark.parametrize(("line", "frame"), FRAMES)
def test_a_frame_in_both_directions(line: bytes, frame: CanFrame) -> None:
    adapter = opened()
    assert adapter.receive(line.replace(b"ABCD", b"abcd")) == [frame]
    assert adapter.take_answer() == (b"Z\r" if frame.extended else b"z\r")
    assert adapter.encode(frame, 0.0) == line
    assert answer(adapter, b"L\r") == b"\r"
    assert adapter.receive(line) == []
    assert answer(adapter, b"") == b"\a", "it only listens"
    answer(adapter, b"C\r")
    assert adapter.encode(frame, 0.0) == b""


def test_bit_rates() -> None:
    for code, rate in enumerate(RATES):
        adapter = SlcanAdapter()
        assert answer(adapter, b"S%d\r" % code) == b"\r"
        assert adapter.bitrate == rate
    for timing, rate in ((b"031C", 125_000), (b"001C", 500_000), (b"0014", 1_000_000)):
        assert answer(adapter, b"s" + timing + b"\r") == b"\r"
        assert adapter.bitrate == rate
    assert answer(opened(), b"S5\r") == b"\a", "not while open"


def test_what_python_can_sends_when_it_opens_and_leaves() -> None:
    adapter = SlcanAdapter()
    assert answer(adapter, b"C\rS6\r\rO\rO\r") == b"\r\r\r\r\r"
    assert (adapter.is_open, adapter.bitrate) == (True, 500_000)
    assert answer(adapter, b"C\r") == b"\r"
    assert not adapter.is_open


def test_timestamps_have_a_minute() -> None:
    adapter = opened()
    answer(adapter, b"Z1\r")
    frame = CanFrame(0x625, b"\x01")
    assert [adapter.encode(frame, at)[-5:] for at in (0.0, 59.999, 60.0)] == [b"0000\r", b"EA5F\r", b"0000\r"]


def test_an_error_frame_sets_a_status_bit_once() -> None:
    adapter = opened()
    assert adapter.encode(CanFrame(ERROR_FLAG | 0x88, bytes(8)), 0.0) == b""
    assert answer(adapter, b"F\rF\r") == b"F80\rF00\r"


@given(st.lists(st.binary(max_size=80) | st.sampled_from([line for line, _ in FRAMES] + [b"O\r", b"S6\r"])))
def test_garbage_in_any_pieces_gives_one_answer_a_line(pieces: list[bytes]) -> None:
    adapter, whole = SlcanAdapter(), SlcanAdapter()
    frames = [frame for piece in pieces for frame in adapter.receive(piece)]
    assert frames == whole.receive(b"".join(pieces))
    replies = adapter.take_answer()
    assert replies == whole.take_answer()
    assert len(adapter._line) <= MAX_LINE + 1
    ends = replies.count(b"\r") + replies.count(b"\a")
    assert ends == b"".join(pieces).count(b"\r")
