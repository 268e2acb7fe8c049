"""What comes by far most often takes a short way: that it does, and where each of these ways ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from motorbus.errors import RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.wire import bulk, encode, packets, stream
from motorbus.families.feetech.wire.packets import BROADCAST, MAX_ID, MAX_LENGTH
from motorbus.families.feetech.wire.recording import Recording
from motorbus.families.feetech.wire.stream import Splitter, Stream

PING_REPLY = wire.encode_status(1, 0, b"")
LAST_ID = wire.encode_status(MAX_ID, 0, b"\x07\x08")
LONG = wire.encode_status(7, 4, bytes(range(40)))


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("the long way")


@pytest.mark.parametrize(
    ("id", "address", "count"), [(0, 0, 1), (MAX_ID, 0, 253), (1, 255, 1), (1, 3, 253), (5, 56, 15)]
)
def test_every_read_that_can_be_is_made_at_once(
    id: int, address: int, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(encode, "_check_span", never)
        patch.setattr(encode, "encode_instruction", never)
        made = wire.read(id, address, count)
    body = bytes((id, 4, 2, address, count))
    assert made == b"\xff\xff" + body + bytes((~sum(body) & 255,))


def test_registers_behind_the_last_one_are_not_written_by_a_sync_write() -> None:
    assert wire.sync_write(250, [(1, bytes(6))])
    with pytest.raises(RequestError):
        wire.sync_write(250, [(1, bytes(7))])


def test_packets_that_follow_one_another_are_not_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    data = PING_REPLY + LAST_ID + LONG + PING_REPLY
    monkeypatch.setattr(Stream, "_hunt", never)
    for given in (data, PING_REPLY, LAST_ID, LONG):
        found = Splitter().feed(given)
        assert b"".join(packet.data for packet in found) == given


def sound(data: bytes, place: int) -> int:
    return Stream(MAX_ID, bytes)._sound(data, place)


def test_a_packet_is_sound_where_all_of_it_is_there() -> None:
    assert [sound(LONG, 0), sound(b"\0" + LONG, 1), sound(b"\0" + LONG, 0)] == [0, 1, -1]
    assert [sound(LONG, -1), sound(LONG[:-1], 0), sound(LONG[:3], 0), sound(LAST_ID, 0)] == [-1, -1, -1, 0]
    cut = b"\xff\xff\x01\x09\x00"
    cut += bytes((~sum(cut[2:]) & 255,))  # sound as far as it goes, and longer than it is
    assert sound(cut, 0) == -1


def inside(data: bytes, start: int, stop: int) -> int:
    return Stream(MAX_ID, bytes)._inside(data, start, stop)


def test_behind_a_bad_sum_the_next_header_counts_or_the_end() -> None:
    bad = LAST_ID[:-1] + bytes((LAST_ID[-1] ^ 1,))
    end = len(bad)
    assert inside(bad + LONG, 0, end) == end
    assert inside(bad, 0, end) == end
    assert inside(bad + b"\x01\xff", 0, end) == end
    ended = b"\xff\xff\x01\x03\x00\x00\xff"
    assert inside(ended, 0, len(ended)) == -1  # what it ends in may begin the next one
    assert inside(bad + b"\xff\xff\x01", 0, end) == end
    within = b"\xff\xff" + LONG
    assert inside(within, 0, len(within)) == 2
    assert inside(b"\xff" + LONG, 0, len(LONG) + 1) == len(LONG) + 1


def test_three_bytes_that_begin_no_packet_are_noise_at_once() -> None:
    for id, held in ((MAX_ID, 3), (MAX_ID + 1, 0)):
        one: Stream[bytes] = Stream(MAX_ID, bytes)
        told = one.runs(bytes((0xFF, 0xFF, id)))
        assert (one.held, bool(told)) == (held, not held)


def test_only_lengths_of_two_and_more_are_those_of_packets() -> None:
    sizes = stream._SIZES
    assert sizes[:2] == (0, 0)
    assert sizes[2:] == tuple(range(6, MAX_LENGTH + 5))


def test_every_rule_counts_from_nothing_on() -> None:
    assert min(rule.fewest for rule in packets.RULES.values()) == 0
    everyone = {code for code, rule in packets.RULES.items() if rule.everyone}
    assert wire.Instruction.UPGRADE in everyone
    assert wire.Instruction.PING not in everyone


def test_where_all_is_sound_nobody_is_doubtful() -> None:
    line = np.frombuffer(PING_REPLY + LAST_ID + LONG, np.uint8)
    (starts, ends), (no_starts, no_ends) = bulk._places(np, line, BROADCAST)
    assert (len(starts), len(ends), len(no_starts), len(no_ends)) == (3, 3, 0, 0)


def test_a_recording_tells_of_the_packets_that_it_found() -> None:
    kinds, ids, codes = Recording("rx").tell([PING_REPLY, LONG])()
    assert (list(ids), list(codes), len(kinds)) == ([1, 7], [0, 4], 2)
