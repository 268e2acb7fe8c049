"""Text of slcan, whole, damaged and cut anywhere: a decoder returns frames that were sent, or none."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.link.slcan import SlcanCodec
from motorbus.simulation.slcan import SlcanAdapter
from tests.links.can_peer import LONG_PING, PING, remote

SOME = b"t62584002600000000000\r"


@st.composite
def frames(draw: st.DrawFn) -> CanFrame:
    extended = draw(st.booleans())
    id = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    if draw(st.booleans()):
        return remote(id, draw(st.integers(0, 8)), extended=extended)
    return CanFrame(id, draw(st.binary(max_size=8)), extended)


@pytest.mark.parametrize(
    ("frame", "line"),
    [
        (PING, b"t62584002600000000000\r"),
        (LONG_PING, b"T00000625101\r"),
        (CanFrame(0, b""), b"t0000\r"),
        (remote(0x12, 3), b"r0123\r"),
        (remote(0x12, extended=True), b"R000000120\r"),
    ],
)
def test_lines_of_slcan(frame: CanFrame, line: bytes) -> None:
    assert SlcanCodec().encode(frame) == line
    assert SlcanCodec().feed(line) == [frame]


@given(frame=frames(), cut=st.integers(0, 40))
def test_what_an_slcan_adapter_writes_is_read(frame: CanFrame, cut: int) -> None:
    adapter, reader = SlcanAdapter(), SlcanCodec()
    adapter.feed(b"S6\rO\r")
    text = adapter.deliver(frame, 1.0)
    assert reader.feed(text[:cut]) + reader.feed(text[cut:]) == [frame]
    assert adapter.feed(SlcanCodec().encode(frame)) == [frame]


@given(data=st.binary(max_size=80))
def test_no_data_makes_a_decoder_raise(data: bytes) -> None:
    reader = SlcanCodec()
    reader.feed(data)
    assert reader.feed(b"\r" + SOME)[-1:], "the next good frame is read"


@pytest.mark.parametrize(
    "line",
    [
        b"t6257400260000000",  # too short for seven
        b"t62574002600000000000",  # one byte too many
        b"t8258" + b"0" * 16,  # twelve bits
        b"t625840026000000000x0",
        b"\xff\xfe",
        b"t62584002600000000000t62584002600000000000",
    ],
)
def test_a_line_that_is_no_frame_is_counted(line: bytes) -> None:
    reader = SlcanCodec()
    assert reader.feed(line + b"\r" + SOME) == [PING]
    assert reader.damaged == 1


def test_replies_are_no_frames() -> None:
    reader = SlcanCodec()
    assert reader.feed(b"\rz\rZ\rV1013\rNSIMU\rF00\rA\r") == []
    assert (reader.damaged, reader.reply) == (0, True)


def test_the_first_reply_counts() -> None:
    reader = SlcanCodec()
    reader.feed(b"\a\n\r")
    assert (reader.refused, reader.reply) == (1, False)
    reader.forget()
    assert reader.reply is None


def test_timestamps_are_known_by_two_in_a_row() -> None:
    reader = SlcanCodec()
    stamped = SOME[:-1] + b"1F3A\r"
    assert reader.feed(stamped) == []
    assert reader.feed(stamped * 2) == [PING, PING]
    assert reader.feed(SOME) == []
    assert reader.feed(stamped) == [PING]
    assert reader.damaged == 2
