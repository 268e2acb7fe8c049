"""Packets against the vendor's manual, and streams that are cut and disturbed anywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise, product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.framing import FrameParser, FrameReceiver
from motorbus.core.request import Event, Noise, Reply
from motorbus.errors import RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.protocol import BROADCAST, MAX_ID, Instruction, Packet, frame
from tests.protocol.feetech.vectors import ALL, INVALID, MANUAL, REPLIES, REQUESTS, VALID, name_of
from tests.protocol.vectors import Vector

# Each of these ends where the packet begins; the last three look like packets that would contain it.
BEFORE = [
    "",
    "FF",
    "FF FF",
    "00",
    "55 FF AA",
    "FF FF 01",
    "FF FF 01 02",
    "FF FF 01 40 00",
    "FF FF 01 FF 03 2A",
]
AFTER = ["", "FF", "FF FF", "00 FF", "FF FF 01", "FF FF 01 09 03 2A"]
REPLY = frame(1, 0, bytes.fromhex("18 05"))
FRAMES = st.builds(
    frame,
    st.sampled_from([0, 1, 2, 253, 254, 255]),
    st.integers(0, 255),
    st.one_of(
        st.binary(max_size=16),
        st.binary(min_size=250, max_size=253),
        st.sampled_from([b"\xff\xff", b"\xff" * 4]),
    ),
)
BROKEN = FRAMES.map(lambda packet: packet[:-1] + bytes((packet[-1] ^ 1,)))
CUT_OFF = FRAMES.flatmap(lambda packet: st.integers(1, len(packet) - 1).map(lambda end: packet[:end]))
RUNS = st.integers(1, 5).map(lambda count: b"\xff" * count)
STREAMS = st.lists(st.one_of(FRAMES, BROKEN, CUT_OFF, RUNS, st.binary(max_size=12)), max_size=8).map(b"".join)
IDS = st.integers(0, MAX_ID)


def top(vector: Vector) -> int:
    return MAX_ID if vector.direction == "status" else BROADCAST


def parse(parser: FrameParser, pieces: Iterable[bytes]) -> list[tuple[bytes, str]]:
    fed = [found for piece in pieces for found in parser.feed(piece)]
    return [*fed, *parser.feed(b"", end=True)]


def valid(found: list[tuple[bytes, str]]) -> list[bytes]:
    return [data for data, fault in found if not fault]


def bytes_of(data: bytes) -> list[bytes]:
    return [data[at : at + 1] for at in range(len(data))]


def packet_of(vector: Vector) -> Packet:
    expected = vector.expected
    is_reply = vector.direction == "status"
    code = expected["error"] if is_reply else Instruction[expected["instruction"]]
    return Packet(expected["servo"], code, vector.parameters)


def packets_in(data: bytes, top: int) -> list[bytes]:
    """All packets in these bytes, by trying each place in turn; independent of parsers."""
    found: list[bytes] = []
    at = 0
    while at < len(data):
        size = data[at + 3] + 4 if len(data) > at + 3 else 6
        packet = data[at : at + size]
        good = len(packet) == size >= 6 and packet[:2] == b"\xff\xff" and packet[2] <= top
        if good and packet[-1] == 255 - sum(packet[2:-1]) % 256:
            found.append(packet)
            at += size
        else:
            at += 1
    return found


# -- vectors ---------------------------------------------------------------------------------------------------


def test_the_manual_prints_23_packets_and_4_of_them_are_wrong() -> None:
    assert len(MANUAL) == 23
    wrong = [vector.id for vector in MANUAL if not vector.valid]
    assert wrong == ["ex5-id7", "ex5-id8", "ex5-id9", "ex5-id10"]
    assert all(vector.source and vector.meaning for vector in ALL)
    assert len({vector.id for vector in ALL}) == len(ALL)


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_valid_packet_is_found_in_any_noise(vector: Vector) -> None:
    assert protocol.decode(vector.data) == packet_of(vector)
    for before, after in product(BEFORE, AFTER):
        data = bytes.fromhex(before) + vector.data + bytes.fromhex(after)
        for pieces in ([data], bytes_of(data)):
            found = parse(protocol.parser(top(vector)), pieces)
            assert valid(found) == [vector.data], f"between {before!r} and {after!r}"
            assert b"".join(piece for piece, _ in found) == data


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_an_invalid_packet_is_noise_whatever_is_around_it(vector: Vector) -> None:
    assert parse(protocol.parser(top(vector)), [vector.data]) == [(vector.data, "checksum")]
    assert f"{protocol.checksum(vector.data[2:-1]):02X}" == vector.expected["checksum"]
    for before, after in product(BEFORE, AFTER):
        data = bytes.fromhex(before) + vector.data + bytes.fromhex(after)
        assert not valid(parse(protocol.parser(top(vector)), [data]))


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_the_encoder_makes_the_same_request_or_refuses_it(vector: Vector) -> None:
    packet = packet_of(vector)
    if packet.code in (Instruction.BOOTLOADER, Instruction.UNKNOWN_09, Instruction.UPGRADE):
        with pytest.raises(RequestError, match="never sent"):
            protocol.instruction(*packet)
    else:
        assert protocol.instruction(*packet) == vector.data


POSE = bytes.fromhex("00 08 00 00 E8 03")
MADE = {
    "ex1-request": protocol.ping(1),
    "ex2-request": protocol.read(1, 0x38, 2),
    "ex3-write-id": protocol.write(BROADCAST, 5, b"\x01"),
    "ex4-request": protocol.write(1, 0x2A, POSE),
    "ex5-id1": protocol.reg_write(1, 0x2A, POSE),
    "ex5-id10-right": protocol.reg_write(10, 0x2A, POSE),
    "ex6-action": protocol.action(),
    "ex7-sync-write": protocol.sync_write(0x2A, [(id, POSE) for id in (1, 2, 3, 4)]),
    "reset-line": protocol.factory_restore(1),
    "clear-turns": protocol.clear_turns(1),
    "calibrate": protocol.calibrate(1, bytes.fromhex("00 04")),
    "sync-read": protocol.sync_read(56, 15, [1, 2, 3]),
}


@pytest.mark.parametrize("id", MADE)
def test_every_request_has_a_function_that_makes_it(id: str) -> None:
    assert MADE[id] == next(vector.data for vector in REQUESTS if vector.id == id)


# -- encoders --------------------------------------------------------------------------------------------------


@given(st.integers(0, 83), st.binary(min_size=1, max_size=40), st.lists(IDS, unique=True, min_size=1))
def test_sync_write_comes_back(address: int, data: bytes, ids: list[int]) -> None:
    items = [(id, data[::-1] if id % 2 else data) for id in ids[: protocol.sync_write_capacity(len(data))]]
    packet = protocol.decode(protocol.sync_write(address, items))
    assert packet[:2] == (254, 0x83)
    assert protocol.decode_sync_write(packet.parameters) == protocol.SyncWrite(
        address, len(data), tuple(items)
    )


@pytest.mark.parametrize(
    ("make", "arguments"),
    [
        *((protocol.ping, (id,)) for id in (255, -1)),
        *((protocol.read, span) for span in ((254, 56, 2), (1, 56, 0), (1, -1, 2), (1, 255, 2), (1, 0, 254))),
        *((protocol.write, what) for what in ((1, 42, b""), (1, 255, b"\x00\x00"))),
        (protocol.reg_write, (1, 42, b"")),
        (protocol.factory_restore, (254,)),
        (protocol.clear_turns, (254,)),
        *((protocol.calibrate, what) for what in ((254,), (1, b"\x00"))),
        *((protocol.sync_read, (56, 2, ids)) for ids in ([], [3, 4, 3], [1, 254], list(range(252)))),
        (protocol.sync_write, (42, [])),
        (protocol.sync_write, (42, [(1, b"")])),
        (protocol.sync_write, (42, [(1, b"\x00\x08"), (2, b"\x00")])),  # unequal data
        (protocol.sync_write, (42, [(id, bytes(7)) for id in range(32)])),  # too many
        (protocol.instruction, (1, 0x01, b"\x00")),  # a PING with parameters
        (protocol.instruction, (1, 0x03, b"\x2a")),  # a WRITE without data
        (protocol.instruction, (1, 0x03, bytes(254))),
        (protocol.instruction, (1, 0x82, b"\x38\x02\x01")),
        (protocol.instruction, (254, 0x83, b"\x2a\x02\x01\x00")),
        (protocol.instruction, (1, 0x55)),
    ],
)
def test_an_impossible_request_is_refused(make: Callable[..., bytes], arguments: tuple[object, ...]) -> None:
    with pytest.raises(RequestError):
        make(*arguments)


def test_the_longest_packets_have_259_bytes() -> None:
    assert len(protocol.write(1, 0, bytes(252))) == 259
    assert len(protocol.sync_read(56, 2, list(range(251)))) == 259
    assert len(protocol.sync_write(0, [(1, bytes(250))])) == 259
    assert [protocol.sync_write_capacity(length) for length in (1, 2, 6, 7, 250)] == [125, 83, 35, 31, 1]


# -- streams ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("top", [MAX_ID, BROADCAST])
@given(data=STREAMS, cuts=st.lists(st.integers(0, 2000), max_size=12))
def test_any_cut_gives_the_same_packets_and_every_byte_once(top: int, data: bytes, cuts: list[int]) -> None:
    places = [0, *sorted({cut % (len(data) + 1) for cut in cuts}), len(data)]
    pieces = [data[start:end] for start, end in pairwise(places)]
    whole = parse(protocol.parser(top), [data])
    assert valid(whole) == packets_in(data, top)
    assert b"".join(piece for piece, _ in whole) == data
    for cut in (pieces, bytes_of(data)):
        assert faults(parse(protocol.parser(top), cut)) == faults(whole)


def faults(found: list[tuple[bytes, str]]) -> list[tuple[int, str]]:
    """The fault of each byte."""
    return [(byte, fault) for data, fault in found for byte in data]


def test_each_bad_packet_is_noise_by_itself_and_what_is_inside_belongs_to_it() -> None:
    bad = REPLY[:-1] + b"\x00"
    assert protocol.parser().feed(bad + bad + b"\x33") == [(bad, "checksum")] * 2 + [(b"\x33", "framing")]
    outer = b"\xff\xff\x02\x0c\x00" + bad + b"\x11\x22\x33"
    assert protocol.parser().feed(outer) == [(outer, "checksum")]


def events(receiver: FrameReceiver, data: bytes) -> list[Event]:
    return [*receiver.feed(data), *receiver.flush()]


@pytest.mark.parametrize("extra", range(1, 300, 37))
def test_the_last_two_of_a_run_of_ff_are_the_header(extra: int) -> None:
    found = events(protocol.receiver(), b"\xff" * extra + REPLY)
    assert found == [Noise(b"\xff" * extra, "framing"), Reply(0, 1, REPLY)]


def test_a_packet_that_claims_more_than_has_come_waits() -> None:
    receiver = protocol.receiver()
    assert receiver.feed(b"\xff\xff\x01\x0a\x00" + REPLY) == []
    assert receiver.held == 13
    assert receiver.flush() == [Noise(b"\xff\xff\x01\x0a\x00", "framing"), Reply(0, 1, REPLY)]
    assert (receiver.held, receiver.flush()) == (0, [])


@pytest.mark.parametrize("vector", [one for one in REPLIES if len(one.data) < 64], ids=name_of)
def test_a_reply_has_the_id_as_key_and_no_single_wrong_byte_makes_another_value(vector: Vector) -> None:
    assert protocol.receiver().feed(vector.data) == [Reply(0, vector.expected["servo"], vector.data)]
    assert frame(*packet_of(vector)) == vector.data
    for at, right in enumerate(vector.data):
        for value in set(range(256)) - {right}:
            data = vector.data[:at] + bytes((value,)) + vector.data[at + 1 :]
            for event in events(protocol.receiver(), data):
                is_like = isinstance(event, Reply) and len(event.data) == len(vector.data)
                assert not (is_like and event.key == vector.data[2])  # type: ignore[union-attr]
