"""Text of slcan and socketcand, whole, damaged and cut anywhere: a decoder returns frames that were sent, or none."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.link.slcan import SlcanCodec
from motorbus.link.socketcand import SocketcandCodec
from motorbus.simulation.slcan import SlcanAdapter
from motorbus.simulation.socketcand import SocketcandAdapter
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


@pytest.mark.parametrize(
    ("frame", "element"),
    [
        (CanFrame(0x123, bytes([1, 0xAB])), b"< send 123 2 01 AB >"),
        (CanFrame(0x123, b""), b"< send 123 0 >"),
        (LONG_PING, b"< send 00000625 1 01 >"),
        (remote(0x12, 3), b"< sendrtr 012 3 >"),
    ],
)
def test_elements_of_socketcand(frame: CanFrame, element: bytes) -> None:
    assert SocketcandCodec().encode(frame) == element


@given(frame=frames(), cut=st.integers(0, 40))
def test_what_an_slcan_adapter_writes_is_read(frame: CanFrame, cut: int) -> None:
    adapter, reader = SlcanAdapter(), SlcanCodec()
    adapter.feed(b"S6\rO\r")
    text = adapter.deliver(frame, 1.0)
    assert reader.feed(text[:cut]) + reader.feed(text[cut:]) == [frame]
    assert adapter.feed(SlcanCodec().encode(frame)) == [frame]


@given(frame=frames(), cut=st.integers(0, 60))
def test_what_a_socketcand_server_writes_is_read(frame: CanFrame, cut: int) -> None:
    server, reader = SocketcandAdapter(), SocketcandCodec()
    server.feed(b"< open can0 >< rawmode >")
    text = server.deliver(frame, 1.0)
    assert reader.feed(text[:cut]) + reader.feed(text[cut:]) == [frame]
    assert server.feed(SocketcandCodec().encode(frame)) == [frame]


@given(data=st.binary(max_size=80))
def test_no_data_makes_a_decoder_raise(data: bytes) -> None:
    for reader, good in ((SlcanCodec(), b"\r" + SOME), (SocketcandCodec(), b">< frame 625 1.0 40 >")):
        reader.feed(data)
        assert reader.feed(good)[-1:], "the next good frame is read"


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


@pytest.mark.parametrize(
    "element",
    [
        b"< frame 625 x 40 >",
        b"< frame 625 >",
        b"< frame 825 1.0 40 >",
        b"< frame 625 1.0 4 >",
        b"< rtr 625 1.0 9 >",
        b"junk ",
    ],
)
def test_an_element_that_is_no_frame_is_counted(element: bytes) -> None:
    reader = SocketcandCodec()
    assert reader.feed(element + b"< frame 625 1.0  >") == [CanFrame(0x625, b"")]
    assert reader.damaged == 1


def test_timestamps_are_known_by_two_in_a_row() -> None:
    reader = SlcanCodec()
    stamped = SOME[:-1] + b"1F3A\r"
    assert reader.feed(stamped) == []
    assert reader.feed(stamped * 2) == [PING, PING]
    assert reader.feed(SOME) == []
    assert reader.feed(stamped) == [PING]
    assert reader.damaged == 2
