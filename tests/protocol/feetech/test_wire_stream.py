"""Packets out of a stream: cut anywhere, disturbed anywhere, and never a wrong one.

The judge of most tests is `packets_in`, a dozen lines that look at the whole of the bytes at once and know
nothing of waiting, buffers or short paths.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Receiver
from motorbus.core.request import Noise, Reply
from motorbus.families.feetech import wire
from tests.protocol.feetech.vectors import REPLIES, name_of
from tests.protocol.vectors import Vector

Event = TypeVar("Event")
HELD = 4096

REPLY = wire.encode_status(1, 0, bytes.fromhex("18 05"))
FRAMES = st.builds(
    wire.frame,
    st.sampled_from([0, 1, 2, 253, 254, 255]),
    st.integers(0, 255),
    st.one_of(
        st.binary(max_size=16),
        st.binary(min_size=250, max_size=253),
        st.sampled_from([b"\xff\xff", b"\xff" * 4]),
    ),
)
BROKEN = FRAMES.map(lambda frame: frame[:-1] + bytes((frame[-1] ^ 1,)))
CUT_OFF = FRAMES.flatmap(lambda frame: st.integers(1, len(frame) - 1).map(lambda end: frame[:end]))
RUNS = st.integers(1, 5).map(lambda count: b"\xff" * count)
STREAMS = st.lists(st.one_of(FRAMES, BROKEN, CUT_OFF, RUNS, st.binary(max_size=12)), max_size=8).map(b"".join)


def packets_in(data: bytes, top: int) -> list[bytes]:
    """Every packet in these bytes, by trying each place in turn."""
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


def parts(data: bytes, cuts: Iterable[int]) -> list[bytes]:
    places = [0, *sorted({cut % (len(data) + 1) for cut in cuts}), len(data)]
    return [data[start:end] for start, end in pairwise(places)]


def run(
    feed: Callable[[bytes], list[Event]], flush: Callable[[], list[Event]], pieces: list[bytes]
) -> list[Event]:
    return [*(event for piece in pieces for event in feed(piece)), *flush()]


def joined(events: list[wire.Packet | Noise]) -> list[wire.Packet | Noise]:
    """The same events with neighbouring noise of one kind made one: how a stream is cut may only change that."""
    told: list[wire.Packet | Noise] = []
    for event in events:
        before = told[-1] if told else None
        if isinstance(event, Noise) and isinstance(before, Noise) and before.fault == event.fault:
            told[-1] = Noise(before.data + event.data, event.fault)
        else:
            told.append(event)
    return told


def split(direction: wire.Direction, pieces: list[bytes]) -> list[wire.Packet | Noise]:
    splitter = wire.Splitter(direction)
    return run(splitter.feed, splitter.flush, pieces)


@pytest.mark.parametrize(("direction", "top"), [("status", 253), ("instruction", 254)])
@given(data=STREAMS, cuts=st.lists(st.integers(0, 2000), max_size=12))
def test_any_cut_gives_the_same_events_and_every_byte_is_in_one(
    direction: wire.Direction, top: int, data: bytes, cuts: list[int]
) -> None:
    whole = split(direction, [data])
    assert [event.data for event in whole if not isinstance(event, Noise)] == packets_in(data, top)
    assert b"".join(event.data for event in whole) == data
    assert joined(split(direction, parts(data, cuts))) == joined(whole)
    assert joined(split(direction, parts(data, range(len(data))))) == joined(whole)


@given(data=STREAMS, cuts=st.lists(st.integers(0, 2000), max_size=12))
def test_the_receiver_of_the_bus_finds_the_same_replies(data: bytes, cuts: list[int]) -> None:
    receiver = wire.StatusReceiver()
    events = run(receiver.feed, receiver.flush, parts(data, cuts))
    assert [event for event in events if isinstance(event, Reply)] == [
        Reply(0, packet[2], packet) for packet in packets_in(data, 253)
    ]
    assert b"".join(event.data for event in events) == data
    assert receiver.held == 0


def test_random_bytes_neither_raise_nor_pile_up_nor_make_a_wrong_packet(rounds: Callable[[int], int]) -> None:
    chance = random.Random(20190219)
    receiver = wire.StatusReceiver()
    replies = 0
    for _ in range(rounds(100_000)):
        # Bytes drawn from few values, so that headers, short lengths and lucky sums are frequent.
        data = bytes(chance.choices([0xFF, 0xFF, 0xFF, 1, 2, 3, 4, 0xFA, 0xFC], k=chance.randrange(40)))
        for event in receiver.feed(data):
            if isinstance(event, Reply):
                replies += 1
                assert wire.decode_status(event.data).id == event.key
                assert sum(event.data[2:]) % 256 == 255
        assert receiver.held <= HELD
    assert replies > rounds(100_000) // 100  # else nothing was tried


def test_much_at_once_leaves_little_behind() -> None:
    receiver = wire.StatusReceiver()
    assert len(receiver.feed(REPLY * 10_000 + b"\xff\xff\x01\xff")) == 10_000
    assert receiver.held == 4
    receiver.feed(b"\xff" * 100_000)
    assert receiver.held <= HELD


@pytest.mark.parametrize("extra", range(1, 300, 7))
def test_the_last_two_of_a_run_of_ff_are_the_header(extra: int) -> None:
    run_of_ff = b"\xff" * extra
    assert split("status", [run_of_ff + REPLY]) == [Noise(run_of_ff, "framing"), wire.decode_status(REPLY)]


@pytest.mark.parametrize("value", range(256))
def test_the_longest_packet_is_read_whatever_it_holds(value: int) -> None:
    longest = wire.encode_status(253, 0xFF, bytes([value]) * 253)
    assert len(longest) == 259
    assert split("status", [longest]) == [wire.decode_status(longest)]
    assert split("status", parts(longest, range(259))) == [wire.decode_status(longest)]


@pytest.mark.parametrize("at", range(9))
def test_a_header_among_the_parameters_is_data(at: int) -> None:
    parameters = bytes(at) + b"\xff\xff\x01\x02\x00\xfc" + bytes(8 - at)
    data = wire.encode_status(1, 0, parameters)
    assert split("status", parts(data, range(len(data)))) == [wire.decode_status(data)]


def test_a_packet_that_claims_more_than_has_come_waits() -> None:
    receiver = wire.StatusReceiver()
    assert receiver.feed(b"\xff\xff\x01\x0a\x00" + REPLY) == []
    assert receiver.held == 13
    # Nothing more comes: what was taken for its parameters turns out to be the answer.
    assert receiver.flush() == [Noise(b"\xff\xff\x01\x0a\x00", "framing"), Reply(0, 1, REPLY)]
    assert receiver.held == 0
    assert receiver.flush() == []


def test_a_good_packet_inside_a_bad_one_is_found_without_flush() -> None:
    receiver = wire.StatusReceiver()
    events = receiver.feed(b"\xff\xff\x02\x0a\x00" + REPLY + b"\x00")
    assert events == [
        Noise(b"\xff\xff\x02\x0a\x00", "checksum"),
        Reply(0, 1, REPLY),
        Noise(b"\x00", "framing"),
    ]


def test_each_bad_packet_is_told_by_itself() -> None:
    bad = REPLY[:-1] + b"\x00"
    assert wire.StatusReceiver().feed(bad + bad + b"\x33\x44") == [
        Noise(bad, "checksum"),
        Noise(bad, "checksum"),
        Noise(b"\x33\x44", "framing"),
    ]


def test_a_bad_packet_inside_a_bad_one_is_part_of_it() -> None:
    bad = b"\xff\xff\x02\x0c\x00" + REPLY[:-1] + b"\x00" + b"\x11\x22\x33"
    assert wire.StatusReceiver().feed(bad) == [Noise(bad, "checksum")]


@pytest.mark.parametrize("direction", ["status", "instruction"])
def test_only_an_instruction_may_be_for_everyone(direction: wire.Direction) -> None:
    action = wire.action()
    read = split(direction, [action])
    assert read == (
        [Noise(action, "framing")] if direction == "status" else [wire.decode_instruction(action)]
    )


def test_replies_of_a_sync_read_come_one_by_one() -> None:
    train = [wire.encode_status(id, 0, bytes((id, 5))) for id in (3, 1, 2)]
    receiver = wire.StatusReceiver()
    assert receiver.feed(b"".join(train)) == [Reply(0, frame[2], frame) for frame in train]


def test_a_gap_in_a_train_costs_the_missing_one_only() -> None:
    train = [wire.encode_status(id, 0, bytes((id, 5))) for id in (1, 2, 3)]
    receiver = wire.StatusReceiver()
    events = [*receiver.feed(train[0] + train[1][:-3] + train[2]), *receiver.flush()]
    assert [event.key for event in events if isinstance(event, Reply)] == [1, 3]


def test_it_is_the_receiver_that_a_bus_expects() -> None:
    receiver: Receiver = wire.StatusReceiver()
    assert receiver.feed(REPLY) == [Reply(0, 1, REPLY)]


def test_a_can_frame_on_a_serial_bus_is_foreign() -> None:
    assert wire.StatusReceiver().feed(CanFrame(0x601, b"\x01\x02")) == [Noise(b"\x01\x02", "foreign")]


@pytest.mark.parametrize("vector", REPLIES, ids=name_of)
def test_no_single_wrong_byte_makes_another_value(vector: Vector) -> None:
    wrong = tried = 0
    for at, right in enumerate(vector.data):
        for value in set(range(256)) - {right}:
            data = vector.data[:at] + bytes((value,)) + vector.data[at + 1 :]
            receiver = wire.StatusReceiver()
            tried += 1
            wrong += any(
                isinstance(event, Reply)
                and event.key == vector.data[2]
                and len(event.data) == len(vector.data)
                for event in [*receiver.feed(data), *receiver.flush()]
            )
    assert tried == 255 * len(vector.data)
    assert wrong == 0
