"""Text of an adapter, whole and damaged, cut anywhere: frames that were sent, or none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.link.slcan import LONGEST, REPLIES_KEPT, SlcanCodec
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


@given(place=st.integers(0, 20), byte=st.integers(0, 255))
def test_one_damaged_character_is_no_frame_or_one_of_its_form(place: int, byte: int) -> None:
    """Only a digit that became another digit is not noticed: slcan has no checksum."""
    reader = SlcanCodec()
    line = bytearray(SOME)
    line[place] = byte
    for frame in reader.feed(bytes(line)):
        assert chr(byte) in "0123456789abcdefABCDEFtrR"
        assert len(frame.data) == 8 or frame.id & REMOTE_FLAG


@pytest.mark.parametrize(
    "line",
    [
        b"t6257400260000000",  # too short for seven
        b"t62574002600000000000",  # one byte too many
        b"t6259400260000000000000",  # nine
        b"t8258" + b"0" * 16,  # twelve bits
        b"T2000062500",
        b"t6258400260000000000",  # half a byte
        b"t625840026000000000x0",
        b"62584002600000000000",
        b"\xff\xfe",
        b"t62584002600000000000t62584002600000000000",
    ],
)
def test_a_line_that_is_no_frame_is_counted(line: bytes) -> None:
    reader = SlcanCodec()
    assert reader.feed(line + b"\r" + SOME) == [PING]
    assert reader.counts.damaged == 1


def test_timestamps_are_known_by_two_in_a_row() -> None:
    reader = SlcanCodec()
    stamped = SOME[:-1] + b"1F3A\r"
    assert reader.feed(stamped) == []
    assert reader.feed(stamped * 2) == [PING, PING]
    assert reader.feed(SOME) == []
    assert reader.feed(stamped) == [PING]
    assert reader.counts.damaged == 2


def test_a_length_too_short_by_two_is_no_timestamp() -> None:
    reader = SlcanCodec()
    reader.feed(SOME)
    assert reader.feed(b"t62564002600000000000\r") == []
    assert reader.counts.damaged == 1


def harmed(line: bytes) -> Iterator[tuple[bytes, bool]]:
    """The line with one bit flipped, one byte lost, or one twice; and whether a digit has become another one."""
    for place, byte in enumerate(line):
        before, after = line[:place], line[place + 1 :]
        yield before + after, False
        yield line[: place + 1] + line[place:], False
        for bit in range(8):
            other = byte ^ 1 << bit
            yield before + bytes([other]) + after, {byte, other} <= set(b"0123456789ABCDEFabcdef")


@pytest.mark.parametrize(
    "frame",
    [
        CanFrame(0x5A5, bytes.fromhex("4B 02 60 00 2C 01 00 00")),
        CanFrame(0x5A5, bytes.fromhex("2C 01 00 00")),
        CanFrame(0x185, bytes.fromhex("2C 01 00 00"), extended=True),
    ],
)
def test_harm_to_one_byte_is_noticed_unless_a_digit_becomes_another(frame: CanFrame) -> None:
    """A line has no checksum: this is all that can go unnoticed, and the next line but one is read again."""
    for line, is_digit in harmed(SlcanCodec().encode(frame)):
        reader = SlcanCodec()
        frames = reader.feed(line + SlcanCodec().encode(PING) * 2)
        assert frames[-1] == PING
        others = [one for one in frames if one not in (frame, PING)]
        assert is_digit or not others, (line, others)
        assert all(len(one.data) == len(frame.data) for one in others)


def test_replies_are_no_frames() -> None:
    reader = SlcanCodec()
    assert reader.feed(b"\rz\rZ\rV1013\rNSIMU\rF00\rA\r") == []
    assert (reader.counts.damaged, reader.replies) == (0, [True] * 7)
    reader.feed(b"\a\n\r")
    assert (reader.counts.refused, reader.replies[-2:]) == (1, [False, True])
    reader.forget()
    assert reader.replies == []


def test_the_number_of_kept_replies_is_limited() -> None:
    """Every frame that is sent brings one."""
    reader = SlcanCodec()
    reader.feed(b"\r\a" + b"z\r" * 100_000)
    assert reader.replies[:3] == [True, False, True]
    assert len(reader.replies) == REPLIES_KEPT


def test_a_refusal_in_the_midst_of_a_line_damages_it() -> None:
    reader = SlcanCodec()
    assert reader.feed(b"t6258400\a" + SOME) == [PING]
    assert (reader.counts.damaged, reader.counts.refused) == (1, 1)


def test_frames_of_can_fd_are_foreign() -> None:
    reader = SlcanCodec()
    assert reader.feed(b"d1239" + b"00" * 12 + b"\r") == []
    assert (reader.counts.dropped, reader.counts.damaged) == (1, 0)


@pytest.mark.parametrize("reader", [SlcanCodec(), SocketcandCodec()])
def test_text_without_end_is_dropped(reader: SlcanCodec | SocketcandCodec) -> None:
    for _ in range(40):
        reader.feed(b"x" * 100)
    assert reader.counts.damaged >= 40 * 100 // (LONGEST + 100)


def test_errors_on_the_bus_of_a_server() -> None:
    reader = SocketcandCodec()
    assert reader.feed(b"< error 004 1.5 >") == [CanFrame(0x4 | ERROR_FLAG, bytes(8))]
    assert reader.feed(b"< error unknown command >") == []
    assert (reader.counts.refused, reader.counts.damaged) == (1, 0)


@pytest.mark.parametrize(
    "element",
    [
        b"< frame 625 x 40 >",
        b"< frame 625 >",
        b"< frame 6250 1.0 40 >",
        b"< frame 825 1.0 40 >",
        b"< frame 625 1.0 4 >",
        b"< frame 625 1.0 " + b"00" * 9 + b" >",
        b"< rtr 625 1.0 9 >",
        b"< rtr 625 1.0 99999999999 >",
        b"junk ",
    ],
)
def test_an_element_that_is_no_frame_is_counted(element: bytes) -> None:
    reader = SocketcandCodec()
    assert reader.feed(element + b"< frame 625 1.0  >") == [CanFrame(0x625, b"")]
    assert reader.counts.damaged == 1


def test_other_elements_are_ignored() -> None:
    reader = SocketcandCodec()
    assert reader.feed(b"< hi >< ok > < echo > < > < frame 00000625 1.000000 AB CD >") == [
        CanFrame(0x625, b"\xab\xcd", True)
    ]
    assert (reader.counts.damaged, reader.counts.refused) == (0, 0)
