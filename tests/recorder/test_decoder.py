"""A line taken apart as it comes: places, times and ways of what is found, and noise told once it has ended."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import PIECE, Packet
from motorbus.errors import RequestError
from motorbus.recorder import Decoder

READ = bytes.fromhex("ff ff 01 04 02 38 02 be")
ANSWER = bytes.fromhex("ff ff 01 04 00 18 05 dd")
ECHO = Packet(0, READ, "either", 1, 2, "", None)


def test_requests_and_answers_of_one_line_are_told_apart() -> None:
    decoder = motorbus.recorder.Decoder("feetech")
    found = decoder.feed(READ + ANSWER + READ + READ[:3])
    assert list(found) == [
        Packet(0, READ, "request", 1, 2, "", None),
        Packet(8, ANSWER, "reply", 1, 0, "", None),
        ECHO._replace(start=16),
    ]
    assert decoder.flush() == [Packet(24, READ[:3], "noise", -1, -1, "framing", None)]
    assert decoder.flush() == []


@pytest.mark.parametrize(("way", "kind"), [("rx", "reply"), ("tx", "request")])
def test_a_known_way_decides(way: str, kind: str) -> None:
    assert [packet.kind for packet in Decoder("feetech", way).feed(READ + ANSWER)] == [kind, kind]
    assert [packet.kind for packet in Decoder("feetech").feed(READ + ANSWER, way=way)] == [kind, kind]


def test_a_packet_has_the_time_and_the_place_of_its_first_byte() -> None:
    decoder = Decoder("feetech")
    assert list(decoder.feed(b"\x00" + READ[:3], 1.0)) == []
    (noise, request) = decoder.feed(READ[3:] + ANSWER[:1], 2.0)
    assert (noise.start, noise.at, noise.fault) == (0, 1.0, "framing")
    assert (request.start, request.at) == (1, 1.0)
    assert list(decoder.feed(ANSWER[1:4], 3.0)) == []
    first, second = decoder.feed(ANSWER[4:] + ANSWER, 4.0)
    assert [(one.start, one.at) for one in (first, second)] == [(9, 2.0), (17, 4.0)]


def test_the_columns_tell_the_same() -> None:
    decoder = Decoder("feetech")
    decoder.feed(READ[:3], 1.0)
    found = decoder.feed(READ[3:] + b"\x00" + ANSWER, 2.0)
    assert (found.start, found.at) == ([0, 8, 9], [1.0, 2.0, 2.0])
    assert (found.kind, found.node, found.code, found.fault) == ([1, 0, 2], [1, -1, 1], [2, -1, 0], [0, 2, 0])
    assert found.data == [READ, b"\x00", ANSWER]
    assert (len(found), found[1:], found[-1].kind) == (3, [found[1], found[2]], "reply")
    assert Decoder("feetech").feed(READ).at is None


def test_ways_are_kept_apart_and_places_counted_over_all() -> None:
    decoder = Decoder("feetech")
    assert list(decoder.feed(READ[:5], 1.0, "tx")) == []
    assert list(decoder.feed(ANSWER[:4], 1.5, "rx")) == []
    assert list(decoder.feed(READ[5:], 2.0, "tx")) == [Packet(0, READ, "request", 1, 2, "", 1.0)]
    assert list(decoder.feed(ANSWER[4:] + ANSWER, 2.5, "rx")) == [
        Packet(5, ANSWER, "reply", 1, 0, "", 1.5),
        Packet(16, ANSWER, "reply", 1, 0, "", 2.5),
    ]
    decoder.feed(READ[:2], None, "tx")
    decoder.feed(ANSWER[:2], 3.0, "rx")
    assert [(packet.start, packet.at) for packet in decoder.flush()] == [(24, None), (26, 3.0)]
    assert [list(rest) for rest in decoder.rest()] == [[], []]


def test_places_are_those_of_the_recording_without_times_too() -> None:
    decoder = Decoder("feetech")
    decoder.feed(READ + READ[:2], way="tx")
    decoder.feed(ANSWER, way="rx")
    assert [packet.start for packet in decoder.feed(READ[2:] + READ, way="tx")] == [8, 24]


def test_noise_is_told_when_it_ends() -> None:
    decoder = Decoder("feetech")
    assert [len(decoder.feed(b"\x00")) for _ in range(9)] == [0] * 9
    noise, reply = decoder.feed(ANSWER)
    assert (noise.data, noise.start, reply.start) == (b"\x00" * 9, 0, 9)
    bad = ANSWER[:-1] + b"\x00"
    assert [(one.data, one.fault) for one in decoder.feed(bad + bad + b"\x33" + ANSWER)] == [
        (bad + bad, "checksum"),
        (b"\x33", "framing"),
        (ANSWER, ""),
    ]


def test_long_noise_is_not_hoarded() -> None:
    decoder = Decoder("feetech")
    assert [len(packet.data) for packet in decoder.feed(b"\x00" * (2 * PIECE + 1))] == [PIECE, PIECE]
    assert [(packet.start, len(packet.data)) for packet in decoder.flush()] == [(2 * PIECE, 1)]
    assert [len(packet.data) for packet in decoder.feed(b"\x00" * PIECE)] == [PIECE]
    assert decoder.flush() == []


def test_frames_are_numbered_and_stand_by_themselves() -> None:
    decoder = Decoder("kst")
    asked = CanFrame(0x625, bytes.fromhex("4003600000000000"))
    other = CanFrame(0x123, b"\x01\x02")
    told = [list(decoder.feed(frame, at)) for at, frame in enumerate((asked, other, other))]
    assert told == [
        [Packet(0, asked.flat(), "request", 0x25, 0x40_6003_00, "", 0)],
        [Packet(1, other.flat(), "noise", -1, -1, "foreign", 1)],
        [Packet(2, other.flat(), "noise", -1, -1, "foreign", 2)],
    ]
    assert decoder.flush() == []


@pytest.mark.parametrize(
    ("family", "data"), [("kst", b"\xff"), ("feetech", CanFrame(1, b"")), ("feetech", "FF"), ("kst", None)]
)
def test_what_does_not_fit_the_line_is_refused_and_changes_nothing(family: str, data: Any) -> None:
    decoder = Decoder(family)
    with pytest.raises(RequestError):
        decoder.feed(data)
    assert decoder.rest() == []


@pytest.mark.parametrize("kind", [bytearray, memoryview])
def test_bytes_may_be_any_buffer(kind: Any) -> None:
    """Which is not held on to."""
    decoder, buffer = Decoder("feetech"), bytearray(b"\x00" + READ[:3])
    decoder.feed(kind(buffer))
    buffer[:] = bytes(len(buffer))
    assert [packet.data for packet in decoder.feed(kind(READ[3:]))] == [b"\x00", READ]
    twice = bytes(byte for one in READ for byte in (one, 0x55))
    assert [packet.data for packet in Decoder("feetech").feed(memoryview(twice)[::2])] == [READ]  # type: ignore[arg-type]


def test_an_unknown_way_is_refused() -> None:
    with pytest.raises(RequestError, match="'up'"):
        Decoder("feetech", "up")
    decoder = Decoder("feetech")
    with pytest.raises(RequestError, match="'up'"):
        decoder.feed(READ, way="up")
    assert [packet.start for packet in decoder.feed(READ)] == [0]
