"""An slcan adapter, line by line: what it answers in which state, and what garbage cannot do to it."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.simulation.adapter import Adapter
from motorbus.simulation.slcan import LONGEST_LINE, RATES, SlcanAdapter

FRAME = CanFrame(0x625, bytes.fromhex("2203600084030000"))
LINE = b"t62582203600084030000\r"


def told(adapter: SlcanAdapter, text: bytes) -> bytes:
    """What it answers to this; frames in it are dropped."""
    adapter.feed(text)
    return adapter.take()


def opened(**options: bool) -> SlcanAdapter:
    adapter = SlcanAdapter(**options)
    assert told(adapter, b"S6\rO\r") == b"\r\r"
    return adapter


def test_it_is_an_adapter() -> None:
    adapter: Adapter = SlcanAdapter()
    assert (adapter.open, adapter.bitrate) == (False, None)


# The bit rate.


@pytest.mark.parametrize("code", range(9))
def test_the_bit_rates(code: int) -> None:
    adapter = SlcanAdapter()
    assert told(adapter, b"S%d\r" % code) == b"\r"
    assert adapter.bitrate == RATES[code]


@pytest.mark.parametrize("line", [b"S9", b"S", b"S66", b"S-", b"s031", b"s031CC", b"s03 1", b"s0x1"])
def test_no_bit_rate(line: bytes) -> None:
    adapter = SlcanAdapter()
    assert told(adapter, line + b"\r") == b"\a"
    assert adapter.bitrate is None


@pytest.mark.parametrize("line", [b"S5\r", b"s031C\r"])
def test_no_bit_rate_while_open(line: bytes) -> None:
    adapter = opened()
    assert told(adapter, line) == b"\a"
    assert adapter.bitrate == 500_000


# Opening and closing.


def test_what_python_can_says_when_it_opens_and_leaves() -> None:
    adapter = SlcanAdapter()
    assert told(adapter, b"C\rS6\r\rO\rO\r") == b"\r\r\r\r\r"
    assert (adapter.open, adapter.bitrate) == (True, 500_000)
    assert told(adapter, b"C\r") == b"\r"
    assert not adapter.open
    assert adapter.bitrate == 500_000


def test_without_a_bit_rate_it_opens_at_whatever_the_bus_has() -> None:
    adapter = SlcanAdapter()
    assert told(adapter, b"O\r") == b"\r"
    assert (adapter.open, adapter.bitrate) == (True, None)


def test_listening_only() -> None:
    adapter = SlcanAdapter()
    assert told(adapter, b"S6\rL\r") == b"\r\r"
    assert adapter.listen_only
    assert adapter.feed(LINE) == []
    assert adapter.take() == b"\a"
    assert adapter.deliver(FRAME, 0.0) == LINE
    told(adapter, b"C\rO\r")
    assert not adapter.listen_only
    assert adapter.feed(LINE) == [FRAME]


# Frames of the host.


@pytest.mark.parametrize(
    ("line", "frame", "answer"),
    [
        (LINE, FRAME, b"z\r"),
        (b"t1230\r", CanFrame(0x123, b""), b"z\r"),
        (b"t7ff2aBcD\r", CanFrame(0x7FF, b"\xab\xcd"), b"z\r"),
        (b"T0000062511F\r", CanFrame(0x625, b"\x1f", True), b"Z\r"),
        (b"T1fffffff0\r", CanFrame(0x1FFFFFFF, b"", True), b"Z\r"),
        (b"r1238\r", CanFrame(0x123 | REMOTE_FLAG, bytes(8), False), b"z\r"),
        (b"R000001230\r", CanFrame(0x123 | REMOTE_FLAG, b"", True), b"Z\r"),
    ],
)
def test_frames(line: bytes, frame: CanFrame, answer: bytes) -> None:
    adapter = opened()
    assert adapter.feed(line) == [frame]
    assert adapter.take() == answer
    assert adapter.deliver(frame, 0.0).lower() == line.lower()
    told(adapter, b"C\rX0\rO\r")
    assert adapter.feed(line) == [frame]
    assert adapter.take() == b"\r"


@pytest.mark.parametrize(
    "line",
    [
        *(
            b"t",
            b"t12",
            b"t123",
            b"t12g0",
            b"t8000",
            b"t1239",
            b"t1231",
            b"t12310",
            b"t1231123",
            b"t12321122zz",
        ),
        *(b"t1232 1 2", b"t12321 2 ", b"t+230", b"t0x10", b"t1_10", b" t1230", b"t1230 ", b"t1231\xb2\xb3"),
        *(
            b"T200000000",
            b"T00000620",
            b"T0000062589",
            b"r12311",
            b"R0000012311",
            b"r1239",
            b"d1230",
            b"D",
            b"b",
        ),
        *(
            b"z",
            b"O0",
            b"C1",
            b"V1",
            b"L0",
            b"X2",
            b"Z",
            b"Y2",
            b"W2",
            b"Q3",
            b"U7",
            b"M0",
            b"m1234567",
            b"\0",
        ),
    ],
)
def test_what_is_malformed_is_refused_and_does_nothing(line: bytes) -> None:
    adapter = opened()
    assert adapter.feed(line + b"\r") == []
    assert adapter.take() == b"\a"
    assert adapter.feed(LINE) == [FRAME]


def test_a_closed_one_sends_and_hears_nothing() -> None:
    adapter = SlcanAdapter()
    assert adapter.feed(LINE) == []
    assert adapter.take() == b"\a"
    assert adapter.deliver(FRAME, 0.0) == b""


def test_a_line_without_end_is_bounded_and_refused_at_its_end() -> None:
    adapter = opened()
    for _ in range(1000):
        adapter.feed(b"t" * 1000)
    assert len(adapter._line) <= LONGEST_LINE + 1
    assert told(adapter, b"\r") == b"\a"
    assert adapter.feed(LINE) == [FRAME]


# Questions and settings.


@pytest.mark.parametrize(
    ("question", "form"), [(b"V", rb"V[0-9]{4}"), (b"N", rb"N[0-9A-Za-z]{4}"), (b"F", b"F00")]
)
def test_questions_in_both_states(question: bytes, form: bytes) -> None:
    for adapter in (SlcanAdapter(), opened()):
        assert re.fullmatch(form + rb"\r", told(adapter, question + b"\r"))


@pytest.mark.parametrize(
    "line", [b"Z0", b"X1", b"W0", b"M00000000", b"mffffffff", b"Q0", b"Q2", b"U0", b"U6"]
)
def test_settings(line: bytes) -> None:
    assert told(SlcanAdapter(), line + b"\r") == b"\r"


def test_an_error_of_the_bus_is_a_bit_of_the_status_which_reading_clears() -> None:
    adapter = opened()
    assert adapter.deliver(CanFrame(ERROR_FLAG | 0x80, bytes(8)), 0.0) == b""
    assert told(adapter, b"F\rF\r") == b"F80\rF00\r"


# The acceptance filter, as the SJA1000 data sheet lays out its bits.


@pytest.mark.parametrize(
    ("code", "mask", "single", "passing", "stopped"),
    [
        (0, 0xFFFFFFFF, False, [FRAME, CanFrame(1, b"", True)], []),
        # one filter: ID.28-18 in the first 11 bits, then the remote bit, then two data bytes
        (0x625 << 21, 0x001FFFFF, True, [FRAME, CanFrame(0x625, b"")], [CanFrame(0x626, b"")]),
        (0x625 << 21, 0x000FFFFF, True, [FRAME], [CanFrame(0x625 | REMOTE_FLAG, b"")]),
        (0x2203, 0xFFFF0000, True, [FRAME, CanFrame(1, b"\x22\x03")], [CanFrame(1, b"\x22\x04")]),
        (0x625 << 3, 0x7, True, [CanFrame(0x625, b"", True)], [CanFrame(0x624, b"", True)]),
        # two filters of 16 bits each
        (0x625 << 21 | 0x5A5 << 5, 0x001F001F, False, [FRAME, CanFrame(0x5A5, b"")], [CanFrame(0x5A6, b"")]),
        (
            0x12345678,
            0,
            False,
            [CanFrame(0x1234 << 13, b"", True), CanFrame(0x5678 << 13 | 1, b"", True)],
            [FRAME],
        ),
    ],
)
def test_the_filter(
    code: int, mask: int, single: bool, passing: list[CanFrame], stopped: list[CanFrame]
) -> None:
    adapter = SlcanAdapter()
    told(adapter, b"M%08X\rm%08X\rW%d\rS6\rO\r" % (code, mask, single))
    assert [frame for frame in passing if not adapter.deliver(frame, 0.0)] == []
    assert [frame for frame in stopped if adapter.deliver(frame, 0.0)] == []


# Anything at all.


@given(st.lists(st.binary(max_size=64), max_size=20))
def test_garbage_never_raises_and_is_never_kept(pieces: list[bytes]) -> None:
    adapter = SlcanAdapter()
    for piece in pieces:
        for frame in adapter.feed(piece):
            assert len(frame.data) <= 8
        adapter.take()
        assert len(adapter._line) <= LONGEST_LINE + 1
    assert told(adapter, b"\rC\r").endswith(b"\r")
