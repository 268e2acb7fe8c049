"""Recordings of FEETECH lines: who said what, and the short ways for much at once, which give what the search gives."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
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
from motorbus.families.feetech.wire.recording import CAPTURES, Recording
from motorbus.families.feetech.wire.sides import Sides
from tests.protocol.feetech.test_wire_stream import BROKEN, FRAMES, STREAMS, packets_in

PING, READ, ANSWER = wire.ping(1), wire.read(1, 56, 2), wire.encode_status(1, 0, b"\x18\x05")
ALARM = wire.encode_status(1, 1, b"")
"""The answer of servo 1 with a voltage alarm, which is also a PING to it."""

SHORT = b"\xff\xff\x01\x01\xfd"
"""Too short for a packet, with a sum as a packet has it."""


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


# --- much at once -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", [0, 250, 251, 253])
def test_long_packets_are_found_whatever_they_hold(parameters: int) -> None:
    """Adler-32 would reduce the sum over all of the longest."""
    packet = wire.encode_status(253, 0xFF, b"\xff" * parameters)
    finder = stream.Stream(253, bytes)
    assert finder.runs(ANSWER * 64 + packet + ANSWER) == [[*[ANSWER] * 64, packet, ANSWER]]


@pytest.mark.parametrize("least", range(4))
def test_the_sum_of_the_longest_is_not_right_by_being_reduced(least: int) -> None:
    """Of all packets only these have sums, without their headers, that Adler-32 reduces."""
    packet = bytes((0xFF, 0xFF, 253, 255)) + b"\xff" * 254 + bytes((255 - least,))
    finder = stream.Stream(253, bytes)
    assert [*finder.runs(packet + ANSWER), *finder.rest()] == [*_searched(packet + ANSWER)]
    assert packets_in(packet + ANSWER, 253) == [ANSWER]


def test_what_only_sums_up_as_a_packet_is_none() -> None:
    finder = stream.Stream(253, bytes)
    for other in (SHORT, b"\xfe\xff" + READ[2:-1] + bytes((READ[-1] + 1,)), wire.action(), b"\xfd" * 257):
        runs = [*finder.runs(ANSWER + other + PING), *finder.rest()]
        assert [run for run in runs if isinstance(run, list)] == [[ANSWER], [PING]]


def test_a_packet_is_not_taken_before_all_of_it_has_come() -> None:
    """What there is sums up as a whole one does."""
    beginning = wire.frame(1, 0, bytes((0x10, 0x20, 0x30)))[:-2]
    begun = beginning + bytes(((0xFD - sum(beginning)) & 0xFF,))
    finder = stream.Stream(253, bytes)
    assert (finder.runs(begun), finder.held) == ([], len(begun))


def _searched(data: bytes) -> list[stream.Run]:
    """What the search alone makes of it."""
    finder = stream.Stream(253, bytes)
    return [*finder._hunt(data, more=True), *finder.rest()]


def _words(runs: list[stream.Run]) -> list[tuple[bytes, str]]:
    """Packets and noise, neighbouring noise of one kind made one."""
    told: list[tuple[bytes, str]] = []
    for run in runs:
        if not isinstance(run, Noise):
            told += [(packet, "") for packet in run]
        elif told and told[-1][1] == run.fault:
            told[-1] = told[-1][0] + run.data, run.fault
        else:
            told.append((run.data, run.fault))
    return told


@given(data=STREAMS, size=st.integers(1, 900))
def test_much_at_once_is_as_searched(data: bytes, size: int) -> None:
    finder = stream.Stream(253, bytes)
    runs = [run for at in range(0, len(data), size) for run in finder.runs(data[at : at + size])]
    runs += finder.rest()
    assert _words(runs) == _words(_searched(data))
    assert [data for data, fault in _words(runs) if not fault] == packets_in(data, 253)
    assert b"".join(data for data, _ in _words(runs)) == data


def test_damage_of_every_kind_is_told_as_the_search_tells_it(rounds: Callable[[int], int]) -> None:
    chance = Random(20261122)
    damaged = 0
    for _ in range(rounds(100_000) // 100):
        line = bytearray(b"".join(chance.choices((ANSWER, READ, PING, b"\xff", b"\x00\xff\x01"), k=30)))
        for at in chance.sample(range(len(line)), 6):
            line[at] = chance.choice((0xFF, 0, 1, 2, 9, 40, 255 - line[at]))
        runs = _searched(bytes(line))
        damaged += {run.fault for run in runs if isinstance(run, Noise)} == {"checksum", "framing"}
        for size in (1, 13, 100, len(line)):
            finder = stream.Stream(253, bytes)
            cut = [
                run for at in range(0, len(line), size) for run in finder.runs(bytes(line[at : at + size]))
            ]
            assert _words([*cut, *finder.rest()]) == _words(runs)
    assert damaged > rounds(100_000) // 200  # else little was tried


def test_a_false_start_among_many_packets_costs_its_own_bytes() -> None:
    """It swallows the beginning of a packet, so that a packet is looked for in it."""
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


def test_doubt_ends_with_the_next_packet_though_it_comes_with_many() -> None:
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
