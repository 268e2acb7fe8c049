"""Recordings of FEETECH lines: who said what, and the short ways for much at once, which give what the search gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.capture import EITHER, FAULTS, KINDS, REPLY, REQUEST
from motorbus.core.operation import CanFrame, Noise
from motorbus.families.feetech import wire
from motorbus.families.feetech.explain import explain
from motorbus.families.feetech.wire import bulk, stream
from motorbus.families.feetech.wire import tiles as tiling
from motorbus.families.feetech.wire.recording import CAPTURES, Recording
from motorbus.families.feetech.wire.sides import Sides
from motorbus.families.feetech.wire.tiles import sound_until, tiles
from tests.families.feetech.test_wire_stream import BROKEN, FRAMES, STREAMS, packets_in

PING, READ, ANSWER = wire.ping(1), wire.read(1, 56, 2), wire.encode_status(1, 0, b"\x18\x05")
ALARM = wire.encode_status(1, 1, b"")
"""The answer of servo 1 with a voltage alarm, which is also a PING to it."""

SHORT = b"\xff\xff\x01\x01\xfd"
"""Too short for a packet, with a sum as a packet has it."""


@pytest.fixture(autouse=True)
def _new_form() -> None:
    tiling._form.cache_clear()


def kinds(*packets: bytes, way: str = "") -> list[int]:
    return list(Sides(way).tell(list(packets))()[0])


def test_an_alarm_is_told_from_an_instruction_by_what_was_asked() -> None:
    assert PING == ALARM
    assert kinds(PING) == [REQUEST]
    assert kinds(PING, ANSWER) == [REQUEST, REPLY]
    assert kinds(PING, ALARM) == [REQUEST, EITHER]
    assert kinds(wire.write(1, 40, b"\1"), ALARM) == [REQUEST, REPLY]
    assert kinds(wire.write(1, 40, b"\1"), ALARM, ALARM) == [REQUEST, REPLY, REQUEST]
    assert kinds(ANSWER, ALARM) == [REPLY, REQUEST]


def test_the_answer_has_the_length_that_is_due() -> None:
    both = wire.frame(1, 2, b"\x38\x02")  # a READ, or two bytes from a servo with an angle alarm
    assert kinds(wire.read(1, 42, 2), both) == [REQUEST, REPLY]
    assert kinds(wire.read(1, 42, 3), both) == [REQUEST, REQUEST]
    assert kinds(wire.read(2, 42, 2), both) == [REQUEST, REQUEST]
    assert kinds(wire.sync_read(42, 2, (1, 2)), both) == [REQUEST, REPLY]
    assert kinds(wire.sync_read(42, 2, (1, 2)), wire.frame(2, 2, b"\x38\x02"), both) == [
        REQUEST,
        REPLY,
        REPLY,
    ]
    assert kinds(wire.sync_read(42, 2, (2, 3)), both) == [REQUEST, REQUEST]
    assert kinds(wire.sync_write(42, [(1, b"\0\0")]), both) == [REQUEST, REQUEST]
    assert kinds(wire.sync_read(42, 2, (1,)), wire.action(), both) == [REQUEST, REQUEST, REPLY]


def test_who_speaks_to_everyone_is_a_host() -> None:
    assert kinds(ANSWER, wire.frame(254, 0x20)) == [REPLY, REQUEST]


def test_an_echo_may_be_an_answer_but_not_of_everyone() -> None:
    assert kinds(READ, READ, ANSWER, READ) == [REQUEST, EITHER, REPLY, EITHER]
    assert kinds(wire.action(), wire.action()) == [REQUEST, REQUEST]


def test_what_was_asked_is_remembered_from_one_piece_to_the_next() -> None:
    sides = Sides()
    assert [list(sides.tell([one])()[0]) for one in (wire.write(1, 40, b"\1"), ALARM, ALARM)] == [
        [REQUEST], [REPLY], [REQUEST]
    ]  # fmt: skip


def test_an_answer_is_given_once() -> None:
    sides, said = Sides(), (wire.write(1, 40, b"\1"), wire.encode_status(1, 0, b""), ALARM)
    assert [list(sides.tell([one])()[0]) for one in said] == [
        [REQUEST], [REPLY], [REQUEST]
    ]  # fmt: skip


@pytest.mark.parametrize(("way", "kind"), [("rx", REPLY), ("tx", REQUEST)])
def test_a_known_way_says_it(way: str, kind: int) -> None:
    told = Sides(way).tell([PING, ANSWER])()
    assert [list(column) for column in told] == [[kind, kind], [1, 1], [1, 0]]
    assert kinds(ANSWER, way=way) == [kind]


@given(data=st.lists(FRAMES, max_size=9).map(b"".join))
def test_it_agrees_with_what_is_explained(data: bytes) -> None:
    packets = packets_in(data, 254)
    for packet, kind, told in zip(packets, kinds(*packets), explain(b"".join(packets)), strict=True):
        assert told.data == packet
        assert told.title.startswith("status packet") == (kind == REPLY)
        assert ("the same again" in told.title) == (kind == EITHER)


# --- tiles ----------------------------------------------------------------------------------------------------------


def test_tiles_hold_all_bytes_and_packets_are_whole() -> None:
    line = b"\x00\xfd" + ANSWER + b"\xff" + ANSWER + b"\xff\xff\xfe\x02" + READ[:-1]
    assert tiles(line, 253) == [
        b"\x00\xfd", ANSWER, b"\xff", ANSWER, b"\xff", b"\xff", b"\xfe\x02", b"\xff", b"\xff", READ[2:-1]
    ]  # fmt: skip
    assert tiles(wire.action(), 254) == [wire.action()]
    assert tiles(wire.action(), 253) != [wire.action()]
    assert tiles(SHORT, 253) == [b"\xff", b"\xff", SHORT[2:]]


def test_only_sound_packets_are_counted_as_such() -> None:
    bad = ANSWER[:-1] + b"\x00"
    lucky = b"\xfd"  # sums up as a sound packet does
    until = sound_until([ANSWER, READ, bad, ANSWER, lucky, ANSWER, b"\xff"])
    assert [until(index) for index in range(7)] == [2, 2, 2, 4, 4, 6, 6]
    assert sound_until([])(0) == 0


@pytest.mark.parametrize("parameters", [0, 250, 251, 253])
def test_long_packets_are_found_whatever_they_hold(parameters: int) -> None:
    """The longest are no tiles: their sum would wrap."""
    packet = wire.encode_status(253, 0xFF, b"\xff" * parameters)
    assert (tiles(packet, 253) == [packet]) == (parameters <= 250)
    line = ANSWER * 64 + packet + ANSWER
    finder = stream.Stream(253, bytes)
    assert [len(run) if isinstance(run, list) else run for run in finder.runs(line)] in ([66], [64, 1, 1])


@pytest.mark.parametrize("much", [1, 512])
@given(data=STREAMS, size=st.integers(1, 900))
def test_much_at_once_is_as_little_by_little(much: int, data: bytes, size: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stream, "MUCH", much)
        finder = stream.Stream(254, bytes)
        runs = [run for at in range(0, len(data), size) for run in finder.runs(data[at : at + size])]
        runs += finder.rest()
    found = [event for run in runs for event in ([run] if isinstance(run, Noise) else run)]
    assert [event for event in found if isinstance(event, bytes)] == packets_in(data, 254)
    assert b"".join(event if isinstance(event, bytes) else event.data for event in found) == data


def test_a_false_start_among_many_packets_costs_its_own_bytes() -> None:
    """It swallows the beginning of a packet, so that tiles and packets begin at different places for a while."""
    false, many = b"\xff\xff\x01\x0a\x00", [ANSWER] * 70
    finder = stream.Stream(253, bytes)
    runs = finder.runs(b"".join([*many, false, *many, false, PING, PING, *many]))
    found = [event for run in runs for event in ([run.data] if isinstance(run, Noise) else run)]
    assert found == [*many, false, *many, false, PING, PING, *many]
    assert len(runs) < 12  # it has not searched all the way
    assert finder.held == 0


def test_what_was_held_is_gone_when_it_has_been_told() -> None:
    finder = stream.Stream(253, bytes)
    assert finder.runs(ANSWER * 70 + ANSWER[:4]) == [[ANSWER] * 70]
    assert finder.held == 4
    assert finder.runs(ANSWER[4:] + ANSWER * 70) == [[ANSWER] * 71]
    assert (finder.held, finder.rest()) == (0, [])


def test_doubt_ends_with_the_next_packet_though_it_comes_in_tiles() -> None:
    bad = b"\xff\xff\x02\x05\x00" + ANSWER[:4]  # as a whole a packet with a wrong checksum
    finder = stream.Stream(253, bytes)
    assert finder.runs(ANSWER * 70 + bad) == [[ANSWER] * 70, Noise(bad[:5], "checksum")]
    runs = finder.runs(ANSWER[4:] + ANSWER * 70 + b"\x33" + PING)
    assert [packet for run in runs if isinstance(run, list) for packet in run] == [*[ANSWER] * 71, PING]
    assert [run for run in runs if isinstance(run, Noise)] == [Noise(b"\x33", "framing")]


# --- a whole recording ------------------------------------------------------------------------------------------------


def rows(line: bytes, way: str = "") -> list[tuple[Any, ...]]:
    found = bulk.packets(np, line, way)
    return [
        (start, size, KINDS[kind], node, code, FAULTS[fault])
        for start, size, kind, node, code, fault in zip(*(column.tolist() for column in found), strict=True)
    ]


def test_a_recording_in_rows() -> None:
    bad = READ[:-1] + b"\x00"
    line = b"\x11" + READ + ANSWER + bad + wire.action() + b"\xff\xff\xff" + ANSWER[:5]
    assert rows(line) == [
        (0, 1, "noise", -1, -1, "framing"),
        (1, 8, "request", 1, 2, ""),
        (9, 8, "reply", 1, 0, ""),
        (17, 8, "noise", -1, -1, "checksum"),
        (25, 6, "request", 254, 5, ""),
        (31, 8, "noise", -1, -1, "framing"),
    ]
    assert [row[2] for row in rows(line, "tx")] == [
        "noise",
        "request",
        "request",
        "noise",
        "request",
        "noise",
    ]
    assert rows(line, "rx")[3:] == [
        (17, 8, "noise", -1, -1, "checksum"),
        (25, 14, "noise", -1, -1, "framing"),
    ]


def test_a_header_among_parameters_is_data_and_a_packet_in_a_broken_one_is_found() -> None:
    around = wire.encode_status(1, 0, ANSWER + READ)
    assert rows(around) == [(0, 22, "reply", 1, 0, "")]
    assert rows(around[:-1] + b"\x00") == [
        (0, 5, "noise", -1, -1, "checksum"),
        (5, 8, "reply", 1, 0, ""),
        (13, 8, "request", 1, 2, ""),
        (21, 1, "noise", -1, -1, "framing"),
    ]


@pytest.mark.parametrize("end", [b"\x00", b"\xff", b"\xff\xff", ANSWER[:3], ANSWER[:4], ANSWER[:5], SHORT])
def test_what_is_cut_off_at_the_end_is_noise(end: bytes) -> None:
    assert rows(ANSWER + end) == [(0, 8, "reply", 1, 0, ""), (8, len(end), "noise", -1, -1, "framing")]
    assert rows(end) == [(0, len(end), "noise", -1, -1, "framing")]


@pytest.mark.parametrize("length", [0, 1, 2, 255])
def test_lengths_at_the_edge(length: int) -> None:
    packet = b"\xff\xff\x01" + bytes((length,)) + bytes(max(length, 2) - 1)
    line = packet + bytes((255 - sum(packet[2:]) % 256,))
    assert [row[5] for row in rows(line)] == ([""] if length > 1 else ["framing"])


def test_an_alarm_in_a_recording_of_both_ways_is_an_answer() -> None:
    assert [row[2] for row in rows(wire.write(1, 40, b"\1") + ALARM + ALARM)] == [
        "request",
        "reply",
        "request",
    ]
    assert [row[2] for row in rows(wire.action() + ANSWER)] == ["request", "reply"]
    assert [row[2] for row in rows(ANSWER + wire.frame(254, 0x20))] == ["reply", "request"]


def test_few_and_many_at_once_come_in_runs() -> None:
    few = Recording("rx")
    assert few.feed(ANSWER * 3 + b"\x00" + READ * 2) == [[ANSWER] * 3, Noise(b"\x00", "framing"), [READ] * 2]
    many = Recording("rx")
    assert many.feed(ANSWER * 99 + ANSWER[:4]) == [[ANSWER] * 99]
    assert many.feed(ANSWER[4:]) == [[ANSWER]]
    assert many.flush() == []
    assert many.feed(CanFrame(1, b"\2")) == [Noise(b"\2", "foreign")]
    assert (CAPTURES.cutter, CAPTURES.bulk) == (Recording, bulk.packets)


@given(broken=BROKEN)
def test_a_broken_packet_at_a_cut_is_told_the_same(broken: bytes) -> None:
    """What is in doubt at the end of a piece is still in doubt in the next."""
    line = ANSWER * 80 + broken + ANSWER * 80
    recording = Recording("rx")
    cut = len(ANSWER) * 80 + len(broken) // 2
    runs = [*recording.feed(line[:cut]), *recording.feed(line[cut:]), *recording.flush()]
    packets = [packet for run in runs if isinstance(run, list) for packet in run]
    assert packets == packets_in(line, 253)
