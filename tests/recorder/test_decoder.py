"""`recorder.Decoder`: packets of a recording, with their offsets and times, wherever the recording is cut."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError
from motorbus.recorder import Decoder, Packet
from motorbus.recorder.decoder import NOISE_LENGTH
from tests.support.subjects import FAMILIES

READ = bytes.fromhex("ff ff 01 04 02 38 02 be")
REPLY = bytes.fromhex("ff ff 01 04 00 18 05 dd")
ALARM = bytes.fromhex("ff ff 01 04 01 18 05 dc")
"""The alarm bits of this reply are the code of PING."""
PING = bytes.fromhex("ff ff 01 02 01 fb")
SYNC_READ = bytes.fromhex("ff ff fe 06 82 38 02 01 02 3c")
DAMAGED = READ[:-1] + b"\x00"
MOVE = bytes.fromhex("ff aa 5e 00 00 00 00 00 00 00 07")
MOVE_REPLY = MOVE[:6]
DUMP = bytes.fromhex("ff aa 3e 01 00 00") + bytes(range(220))
NOTICE = bytes.fromhex("ee dd")


def decoded(decoder: Decoder, *pieces: bytes | CanFrame) -> list[tuple[str, int, int, str]]:
    """Kind, node, code and fault of each packet."""
    packets = [packet for piece in pieces for packet in decoder.feed(piece)] + decoder.flush()
    assert b"".join(packet.data for packet in packets) == b"".join(
        piece.flat() if isinstance(piece, CanFrame) else piece for piece in pieces
    )
    return [packet[2:6] for packet in packets]


@pytest.mark.parametrize(
    ("family", "direction", "data", "expected"),
    [
        ("feetech", "", READ + REPLY, [("request", 1, 2, ""), ("reply", 1, 0, "")]),
        ("feetech", "", READ + READ, [("request", 1, 2, ""), ("either", 1, 2, "")]),
        ("feetech", "", READ + ALARM, [("request", 1, 2, ""), ("reply", 1, 1, "")]),
        ("feetech", "", REPLY + PING, [("reply", 1, 0, ""), ("request", 1, 1, "")]),
        ("feetech", "", SYNC_READ + ALARM, [("request", 254, 0x82, ""), ("reply", 1, 1, "")]),
        ("feetech", "rx", PING + REPLY, [("reply", 1, 1, ""), ("reply", 1, 0, "")]),
        ("feetech", "rx", SYNC_READ, [("noise", -1, -1, "framing")]),
        ("feetech", "tx", READ + PING, [("request", 1, 2, ""), ("request", 1, 1, "")]),
        ("feetech", "", DAMAGED + b"\x33" + REPLY, [
            ("noise", -1, -1, "checksum"), ("noise", -1, -1, "framing"), ("reply", 1, 0, ""),
        ]),
        ("stepper", "", MOVE + MOVE_REPLY + NOTICE, [
            ("request", 1, 0x5E00, ""), ("reply", 1, 0x5E00, ""), ("notice", 1, 0xEEDD, ""),
        ]),
        ("stepper", "", DUMP, [("reply", 1, 0x3E01, "")]),
        ("stepper", "", MOVE[:-1] + b"\x08", [("noise", -1, -1, "checksum")]),
        ("stepper", "rx", MOVE, [("reply", 1, 0x5E00, ""), ("noise", -1, -1, "framing")]),
        ("stepper", "tx", MOVE + NOTICE, [("request", 1, 0x5E00, ""), ("noise", -1, -1, "framing")]),
        ("stepper", "", DUMP[:-1], [("noise", -1, -1, "framing")]),
    ],
)  # fmt: skip
def test_decoder_identifies_frames_of_serial_line(
    family: str, direction: str, data: bytes, expected: list[tuple[str, int, int, str]]
) -> None:
    assert decoded(Decoder(family, direction), data) == expected
    single = [data[at : at + 1] for at in range(len(data))]
    assert decoded(Decoder(family, direction), *single) == expected


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (CanFrame(0x625, bytes.fromhex("4003600000000000")), ("request", 0x25, 0x40_6003_00, "")),
        (CanFrame(0x5A5, bytes.fromhex("6003600000000000")), ("reply", 0x25, 0x60_6003_00, "")),
        (CanFrame(0x5A5, bytes.fromhex("6003600000000000"), True), ("reply", 0x25, 0x60_6003_00, "")),
        (CanFrame(0x725, b"\x05"), ("notice", 0x25, 0x700, "")),
        (CanFrame(0, b"\x01\x25"), ("request", 0x25, 0, "")),
        (CanFrame(0x123, b"\x01\x02"), ("noise", -1, -1, "foreign")),
    ],
)
def test_decoder_identifies_can_frame(frame: CanFrame, expected: tuple[str, int, int, str]) -> None:
    assert decoded(Decoder("kst"), frame, frame) == [expected, expected]


def test_decoder_uses_receiver_of_family_without_recording_receiver() -> None:
    request, reply = bytes.fromhex("AA 55 00 01 03 CE CF"), bytes.fromhex("AA 5A 02 01 00 CD 91")
    decoder = Decoder(FAMILIES["template"])
    assert decoded(decoder, request, reply) == [("noise", -1, -1, "framing"), ("reply", -1, -1, "")]


@given(
    frames=st.lists(st.sampled_from([READ, REPLY, ALARM, PING, SYNC_READ, DAMAGED, b"\x00", b"\xff" * 3])),
    cuts=st.lists(st.integers(0, 200), max_size=9),
)
def test_cuts_change_no_packet(frames: list[bytes], cuts: list[int]) -> None:
    data = b"".join(frames)
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    pieces = [data[start:end] for start, end in pairwise(places)]
    whole, cut = Decoder("feetech"), Decoder("feetech")
    expected = [*whole.feed(data), *whole.flush()]
    assert [*(packet for piece in pieces for packet in cut.feed(piece)), *cut.flush()] == expected
    assert [packet.start for packet in expected] == [
        sum(len(other.data) for other in expected[:index]) for index in range(len(expected))
    ]


def test_packet_has_offset_and_time_of_its_first_byte() -> None:
    decoder = Decoder("feetech")
    assert decoder.feed(b"\x00" + READ[:3], 1.0) == []
    assert decoder.feed(READ[3:] + REPLY[:1], 2.0) == [
        Packet(0, b"\x00", "noise", -1, -1, "framing", 1.0),
        Packet(1, READ, "request", 1, 2, "", 1.0),
    ]
    assert decoder.feed(REPLY[1:4], 3.0) == []
    packets = decoder.feed(REPLY[4:] + REPLY, 4.0)
    assert [(one.start, one.at) for one in packets] == [(9, 2.0), (17, 4.0)]


def test_decoder_separates_directions_and_counts_offsets_over_all() -> None:
    decoder = motorbus.recorder.Decoder("feetech")
    assert decoder.feed(READ[:5], 1.0, "tx") == []
    assert decoder.feed(REPLY[:4], 1.5, "rx") == []
    assert decoder.feed(READ[5:], 2.0, "tx") == [Packet(0, READ, "request", 1, 2, "", 1.0)]
    assert decoder.feed(REPLY[4:] + REPLY, 2.5, "rx") == [
        Packet(5, REPLY, "reply", 1, 0, "", 1.5),
        Packet(16, REPLY, "reply", 1, 0, "", 2.5),
    ]
    decoder.feed(READ[:2], None, "tx")
    decoder.feed(REPLY[:2], 3.0, "rx")
    assert [(packet.start, packet.at) for packet in decoder.flush()] == [(24, None), (26, 3.0)]
    assert decoder.flush() == []


def test_noise_is_returned_at_its_end_or_in_pieces() -> None:
    decoder = Decoder("feetech")
    assert [len(decoder.feed(b"\x00")) for _ in range(9)] == [0] * 9
    noise, reply = decoder.feed(REPLY)
    assert (noise.data, noise.start, reply.start) == (b"\x00" * 9, 0, 9)
    packets = decoder.feed(b"\x00" * (2 * NOISE_LENGTH + 1))
    assert [len(packet.data) for packet in packets] == [NOISE_LENGTH, NOISE_LENGTH]
    assert [len(packet.data) for packet in decoder.flush()] == [1]


@pytest.mark.parametrize(
    ("family", "arguments"),
    [("kst", (b"\xff",)), ("feetech", (CanFrame(1, b""),)), ("feetech", (READ, None, "up"))],
)
def test_decoder_refuses_wrong_data_and_continues(family: str, arguments: tuple[Any, ...]) -> None:
    decoder = Decoder(family)
    with pytest.raises(RequestError):
        decoder.feed(*arguments)
    assert decoder.flush() == []
    if family == "feetech":
        assert [packet.start for packet in decoder.feed(READ)] == [0]


def test_decoder_copies_a_buffer() -> None:
    decoder, buffer = Decoder("feetech"), bytearray(b"\x00" + READ[:3])
    decoder.feed(buffer)  # type: ignore[arg-type]
    buffer[:] = bytes(len(buffer))
    assert [packet.data for packet in decoder.feed(READ[3:])] == [b"\x00", READ]


@pytest.mark.parametrize("arguments", [("other",), ("feetech", "up")])
def test_decoder_refuses_unknown_name_or_direction(arguments: tuple[Any, ...]) -> None:
    with pytest.raises(RequestError):
        Decoder(*arguments)
