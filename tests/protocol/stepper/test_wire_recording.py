"""Recordings of a controller's line: both ways in one stream, or one way by itself."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.capture import FAULTS, KINDS
from motorbus.core.operation import CanFrame, Noise, Notice, Reply
from motorbus.families.stepper import wire
from motorbus.families.stepper.explain import explain
from motorbus.families.stepper.wire import bulk
from motorbus.families.stepper.wire.recording import CAPTURES, Recording, code_of
from tests.support.subjects import vectors

START, STOP = wire.encode("start_project", project=1), wire.encode("stop_project")
JOG, STEP = wire.encode("jog_forward"), wire.encode("set_step_delay", delay=1000, step=1)
ASK, DUMP = wire.encode("read_project", project=2), wire.encode_dump(2, b"\xff\xaa\xee\xdd" * 55)
LEVEL = wire.encode("read_input", port=1)
KNOWN = [vector.data for vector in vectors("stepper") if isinstance(vector.data, bytes)]


def reply(request: bytes) -> bytes:
    return wire.encode_reply(request)


def rows(line: bytes, way: str = "") -> list[tuple[Any, ...]]:
    found = bulk.frames_in(np, line, way)
    return [
        (size, KINDS[kind], node, code, FAULTS[fault])
        for _, size, kind, node, code, fault in zip(*(column.tolist() for column in found), strict=True)
    ]


def heard(pieces: list[bytes], way: str = "") -> list[tuple[Any, ...]]:
    """The same from a `Recording`, noise of one kind joined."""
    recording = Recording(way)
    told: list[tuple[Any, ...]] = []
    for runs in (*map(recording.feed, pieces), recording.flush()):
        for run in runs:
            if isinstance(run, list):
                told += [
                    (len(one), KINDS[kind], node, code, "")
                    for one, kind, node, code in zip(run, *recording.tell(run)(), strict=True)
                ]
            elif told and told[-1][1::3] == ("noise", run.fault):
                told[-1] = (told[-1][0] + len(run.data), *told[-1][1:])
            else:
                told.append((len(run.data), "noise", -1, -1, run.fault))
    return told


def both(line: bytes, way: str = "") -> list[tuple[Any, ...]]:
    """What all three find: at once, whole and byte by byte."""
    found = rows(line, way) if line else []
    assert heard([line], way) == found
    assert heard([line[at : at + 1] for at in range(len(line))], way) == found
    return found


def test_a_conversation() -> None:
    line = START + reply(START) + wire.NOTICE + ASK + DUMP + JOG + reply(JOG)
    assert both(line) == [
        (11, "request", 1, 0x4E01, ""),
        (6, "reply", 1, 0x4E01, ""),
        (2, "notice", 1, 0xEEDD, ""),
        (11, "request", 1, 0x3E02, ""),
        (226, "reply", 1, 0x3E02, ""),
        (11, "request", 1, 0x030A, ""),
        (6, "reply", 1, 0x030A, ""),
    ]


def test_a_way_that_is_known() -> None:
    answers = reply(START) + wire.NOTICE + DUMP + reply(LEVEL)
    assert [row[:2] for row in both(answers, "rx")] == [
        (6, "reply"),
        (2, "notice"),
        (226, "reply"),
        (6, "reply"),
    ]
    requests = START + STOP + STEP + ASK
    assert [row[:2] for row in both(requests, "tx")] == [(11, "request")] * 4
    assert {row[1] for row in both(answers, "tx")} == {"noise"}
    assert [row[:2] for row in both(requests[:11], "rx")] == [(6, "reply"), (5, "noise")]


def test_a_damaged_request_is_no_reply() -> None:
    bad = JOG[:-1] + b"\x00"
    assert both(bad + reply(JOG)) == [(11, "noise", -1, -1, "checksum"), (6, "reply", 1, 0x030A, "")]
    assert both(bad, "tx") == [(11, "noise", -1, -1, "checksum")]
    assert both(b"\x11" + bad + b"\x12" + JOG, "tx") == [
        (1, "noise", -1, -1, "framing"),
        (11, "noise", -1, -1, "checksum"),
        (1, "noise", -1, -1, "framing"),
        (11, "request", 1, 0x030A, ""),
    ]


@pytest.mark.parametrize("behind", [wire.NOTICE, JOG, b"\x00\x00\x00\x00\xee", b"\x00\x00\x00\x00\xff"])
def test_a_reply_is_one_when_something_begins_right_behind_it(behind: bytes) -> None:
    assert both(reply(JOG) + behind)[0] == (6, "reply", 1, 0x030A, "")


def test_a_reply_before_other_bytes_looks_like_a_damaged_request() -> None:
    assert both(reply(JOG) + bytes(4)) == [(6, "reply", 1, 0x030A, ""), (4, "noise", -1, -1, "framing")]
    assert both(reply(JOG) + bytes(5)) == [(11, "noise", -1, -1, "checksum")]


def test_a_request_behind_a_beginning_of_one_is_found() -> None:
    assert both(JOG[:3] + JOG) == [(3, "noise", -1, -1, "checksum"), (11, "request", 1, 0x030A, "")]
    assert both(JOG[:7] + JOG)[-1] == (11, "request", 1, 0x030A, "")


def test_what_is_not_whole_is_noise_to_the_end() -> None:
    assert both(DUMP[:-1]) == [(225, "noise", -1, -1, "framing")]
    assert both(JOG[:5]) == [(5, "noise", -1, -1, "framing")]
    assert both(JOG + b"\xff") == [(11, "request", 1, 0x030A, ""), (1, "noise", -1, -1, "framing")]
    assert both(b"\xee") == [(1, "noise", -1, -1, "framing")]


def test_what_no_reply_can_be_is_given_up() -> None:
    assert both(b"\xff\xaa\x5e\x01\x00\x00", "rx") == [(6, "noise", -1, -1, "framing")]
    assert both(b"\xff\xaa\x5e\x01" + reply(STOP), "rx")[-1] == (6, "reply", 1, 0x5E00, "")


def test_whatever_stands_together() -> None:
    chance = Random(20260122)
    pieces = (
        *KNOWN,
        DUMP,
        JOG[:-1] + b"\x00",
        b"\xff",
        b"\xee",
        b"\xff\xaa",
        b"\x00",
        b"\xff\xee",
        b"\xaa\xdd",
        JOG[:7],
    )
    for _ in range(100):
        line = b"".join(chance.choices(pieces, k=chance.randrange(1, 9)))
        for way in ("", "rx", "tx"):
            assert heard([line], way) == rows(line, way)


@pytest.mark.parametrize(
    "behind", [b"\xff\x00\x00\x00\x00", b"\x00\xaa\x00\xdd\x00", b"\xee\x00\x00\x00\x00"]
)
def test_half_a_header_begins_nothing(behind: bytes) -> None:
    assert both(reply(JOG) + behind) == [(11, "noise", -1, -1, "checksum")]
    assert both(behind + reply(JOG)) == [(5, "noise", -1, -1, "framing"), (6, "reply", 1, 0x030A, "")]


def test_a_notice_behind_a_reply_at_any_distance() -> None:
    for gap in range(6):
        found = both(reply(JOG) + b"\x00" * gap + wire.NOTICE)
        assert found[0] == ((6, "reply", 1, 0x030A, "") if gap < 5 else (11, "noise", -1, -1, "checksum"))
        assert found[-1] == (2, "notice", 1, 0xEEDD, "")


def test_what_is_complete_is_told_at_once() -> None:
    assert Recording("rx").feed(reply(JOG)) == [[reply(JOG)]]
    assert Recording("rx").feed(DUMP) == [[DUMP]]
    assert Recording().feed(wire.NOTICE) == [[wire.NOTICE]]
    assert Recording().feed(JOG) == [[JOG]]
    assert Recording().feed(reply(JOG)) == []
    assert Recording().feed(b"\x01\xff") == [Noise(b"\x01", "framing")]
    assert Recording("rx").feed(b"\x01\x02\x03") == [Noise(b"\x01\x02\x03", "framing")]


def test_code_and_owner() -> None:
    assert [code_of(packet) for packet in (JOG, reply(STEP), wire.NOTICE)] == [0x030A, 0x0307, 0xEEDD]
    assert (CAPTURES.cutter, CAPTURES.bulk) == (Recording, bulk.frames_in)
    assert Recording().feed(CanFrame(1, b"\2")) == [Noise(b"\2", "foreign")]


@given(parts=st.lists(st.sampled_from([*KNOWN, b"\xff", b"\xee", b"\x00", b"\xff\xaa"]), max_size=8))
def test_one_way_is_as_its_receiver_hears_it(parts: list[bytes]) -> None:
    line = b"".join(parts)
    receiver = wire.Receiver()
    events = [*receiver.feed(line), *receiver.flush()]
    expected = [len(event.data) for event in events if isinstance(event, Reply | Notice)]
    assert [row[0] for row in heard([line], "rx") if row[1] != "noise"] == expected


@pytest.mark.parametrize(
    "vector", [vector for vector in vectors("stepper") if vector.valid], ids=lambda one: one.id
)
def test_known_frames_are_what_is_explained(vector: Any) -> None:
    titles = [one.title for one in explain(vector.data)]
    assert len(titles) == 1
    ((size, kind, *_),) = both(vector.data)
    assert size == len(vector.data)
    words = {"request": ("request",), "reply": ("reply", "dump"), "notice": ("a project",)}
    assert titles[0].startswith(words[kind])


@pytest.mark.parametrize("size", [3, 4, 5])
def test_a_recording_that_ends_within_a_reply_whose_rest_would_be_zeros(size: int) -> None:
    """Nothing that was not recorded is part of a reply."""
    (told,) = both(bytes.fromhex("FFAA1E000000")[:size], "rx")
    assert told[:2] == (size, "noise")
