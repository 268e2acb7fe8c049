"""Two on one wire, bit by bit: worked out by hand, and how often it shows on a bus."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.families.feetech.simulator.collision import Received, Speech, heard, overlapping, received
from tests.simulators.feetech.host import ALL, PING, READ, Host, packet

BIT = 1e-6


def speech(data: str | bytes, start: float = 0.0, bit: float = BIT) -> Speech[None]:
    """Bytes from a moment on, at 1 Mbit/s."""
    return Speech(start, bytes.fromhex(data) if isinstance(data, str) else data, bit, None)


def test_one_alone_is_heard_as_it_speaks() -> None:
    assert heard([speech("FF 00 55", 3.0)], BIT) == b"\xff\x00\x55"
    assert [one.value for one in received([speech("FF 00 55", 3.0)], BIT)] == [0xFF, 0x00, 0x55]


def test_each_byte_has_its_moment() -> None:
    found = list(received([speech("41 42")], BIT))
    assert [one.at for one in found] == pytest.approx([0.0, 10e-6])


@given(st.binary(min_size=1, max_size=30), st.binary(min_size=1, max_size=30))
def test_at_the_same_moment_every_low_bit_wins(one: bytes, other: bytes) -> None:
    length = max(len(one), len(other))
    pairs = zip(one.ljust(length, b"\xff"), other.ljust(length, b"\xff"), strict=True)
    assert heard([speech(one), speech(other)], BIT) == bytes(a & b for a, b in pairs)


@given(st.binary(min_size=1, max_size=30), st.floats(0, 0.49))
def test_the_same_bytes_within_half_a_bit_are_heard_as_they_are(data: bytes, late: float) -> None:
    # each low pulse gets longer by less than half a bit, which no sample in the middle of a bit sees
    assert heard([speech(data), speech(data, late * BIT)], BIT) == data


def test_by_hand_three_bits_late() -> None:
    # FF is one low bit, the start bit: low 0 to 1 of the first, 3 to 4 of the second. The receiver looks at 3.5,
    # which is its bit 2, and sees a low one; all others are high: 1111 1011
    assert heard([speech("FF"), speech("FF", 3 * BIT)], BIT) == b"\xfb"


def test_by_hand_nine_bits_late() -> None:
    # the second start bit falls on the first stop bit: low from 9 to 10, seen at 9.5. The byte is FF with a framing
    # error, its falling edge came before the receiver was ready for it, and FF has no other one: it is lost
    both = [speech("FF"), speech("FF", 9 * BIT)]
    assert list(received(both, BIT)) == [Received(0.0, 0xFF, False)]
    assert heard(both, BIT) == b"\xff"
    assert heard(both, BIT, drop_unframed=True) == b""


def test_by_hand_nine_and_a_half_bits_late() -> None:
    # the edge comes just when the receiver waits for the next byte: half a bit early, and both are heard
    both = [speech("FF"), speech("A5", 9.6 * BIT)]
    assert heard(both, BIT) == b"\xff\xa5"


def test_a_long_low_is_a_zero_with_a_low_stop_bit() -> None:
    # 00 is low for 9 bits; another one 5 bits late keeps the wire low until 14
    found = list(received([speech("00"), speech("00", 5 * BIT)], BIT))
    assert [(one.value, one.framed) for one in found] == [(0, False)]


def test_a_gap_too_short_to_be_seen_is_none() -> None:
    # 00 ends at 9; one that pulls the wire low a thousandth of a bit later makes no edge
    found = list(received([speech("00"), speech("00", 9.001 * BIT)], BIT))
    assert [(one.value, one.framed) for one in found] == [(0, False)]


def test_a_spike_is_no_start_bit() -> None:
    assert heard([speech("FF", 0.0, BIT / 4), speech("FF", 40 * BIT)], BIT) == b"\xff"


def test_who_talks_at_once() -> None:
    first, second, third = speech("00 00"), speech("00", 15 * BIT), speech("00", 25 * BIT)
    assert list(overlapping([third, second, first])) == [[first, second], [third]]
    assert list(overlapping([])) == []


def test_a_speech_within_a_longer_one_does_not_shorten_it() -> None:
    longer, within, after = speech(bytes(10)), speech("00", 10 * BIT), speech("00", 90 * BIT)
    assert list(overlapping([longer, within, after])) == [[longer, within, after]]


# On a bus.


def reads(count: int, *, alike: bool, jitter: float) -> Iterator[tuple[list[str], Host]]:
    """15-byte reads of an id that two servos have; unless they are alike, they stand at random places."""
    host, dice = Host((1, 1), reply_jitter=jitter, seed=7), Random(3)
    for _ in range(count):
        if not alike:
            host.bus.servos[1].raw_position = dice.randrange(4096)
        yield host.wait(0.01).say(packet(1, READ, 56, 15)), host


def is_clean(replies: list[str]) -> bool:
    """One reply of the right length with a right checksum."""
    data = bytes.fromhex("".join(replies))
    return len(data) == 21 and data[:5] == b"\xff\xff\x01\x11\x00" and (sum(data[2:]) & 255) == 255


def test_how_often_two_with_one_id_are_heard_as_two() -> None:
    """On two STS3215 with one id about 4 of 10 reads of 15 bytes were garbled or doubled (servolab).

    What this model gives: when their readings differ, 99 % at any jitter, since the bits of one
    garble the checksum of the other. When their readings are the same, 0 % without jitter, 41 % with 1.4 µs of it (at
    1 Mbit/s half a bit is what goes unnoticed), 58 % with 2 µs, 95 % with 20 µs. So the measured 40 % is what two
    servos that read alike show with a jitter of little more than a bit; it lies between the two, and in their order.
    """
    bad = {
        (alike, jitter): sum(not is_clean(replies) for replies, _ in reads(400, alike=alike, jitter=jitter))
        / 400
        for alike in (True, False)
        for jitter in (0.0, 1.4e-6, 20e-6)
    }
    assert bad[True, 0.0] == 0
    assert 0.35 <= bad[True, 1.4e-6] <= 0.5
    assert 0.9 <= bad[True, 20e-6] <= 1.0
    assert all(bad[False, jitter] >= 0.98 for jitter in (0.0, 1.4e-6, 20e-6))


def test_one_alone_is_never_garbled_by_its_jitter() -> None:
    host = Host((1,), reply_jitter=20e-6, seed=7)
    assert all(
        is_clean(host.wait(0.01).say(packet(1, READ, 56, 15))) for _ in range(120)
    )  # servolab: 0 of 120


def test_a_long_jitter_makes_two_replies_of_some() -> None:
    lengths = {
        sum(len(bytes.fromhex(one)) for one in replies) for replies, _ in reads(300, alike=True, jitter=1e-3)
    }
    assert 42 in lengths


def test_a_reply_that_looks_right_is_that_of_one_of_them() -> None:
    # what a host cannot see by listening: 15 bytes that one of the two has really sent
    for replies, host in reads(500, alike=False, jitter=0.0):
        if is_clean(replies):
            position = int.from_bytes(bytes.fromhex(replies[0])[5:7], "little")
            assert position in [servo.raw_position for servo in host.bus.servos]


def test_the_same_seed_gives_the_same_bytes() -> None:
    first = [replies for replies, _ in reads(50, alike=False, jitter=5e-6)]
    assert first == [replies for replies, _ in reads(50, alike=False, jitter=5e-6)]


def test_a_broadcast_ping_collides_bit_by_bit() -> None:
    # 01 & 02 & 03 = 00, FC & FB & FA = F8
    assert Host((1, 2, 3)).say(packet(ALL, PING)) == ["FF FF 00 02 00 F8"]
    jittered = Host((1, 2, 3), reply_jitter=3e-6, seed=4).say(packet(ALL, PING))
    assert jittered != ["FF FF 00 02 00 F8"]


def test_a_port_may_drop_bytes_with_a_low_stop_bit() -> None:
    delivered = Host((1, 2, 3), reply_jitter=3e-6, seed=4).say(packet(ALL, PING))
    dropped = Host((1, 2, 3), reply_jitter=3e-6, seed=4, framing="drop").say(packet(ALL, PING))
    assert len("".join(dropped)) < len("".join(delivered))
