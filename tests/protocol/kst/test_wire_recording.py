"""Recordings of a CAN bus with KST servos: what each frame is, whoever listens."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from motorbus.core.capture import FAULTS, KINDS
from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame, Noise
from motorbus.families.kst import wire
from motorbus.families.kst.wire import bulk
from motorbus.families.kst.wire.notices import encode_alarm, encode_boot, encode_report, encode_start
from motorbus.families.kst.wire.recording import CAPTURES, Recording

NOBODY = ("noise", -1, -1)
FRAMES = [
    (wire.encode_upload(0x25, 0x6003), ("request", 0x25, 0x40_6003_00)),
    (wire.encode_upload(0, 0x6003, 2), ("request", 0, 0x40_6003_02)),
    (wire.encode_upload(127, 0x6003, extended=True), ("request", 127, 0x40_6003_00)),
    (wire.encode_download(5, 0x1234, 7, b"\1"), ("request", 5, 0x22_1234_07)),
    (wire.encode_abort(5, 0x6003, 0, 1), ("request", 5, 0x80_6003_00)),
    (wire.encode_segment(5, 1), ("request", 5, 0x70_0000_00)),
    (CanFrame(0x605, bytes.fromhex("6012345600000000")), ("request", 5, 0x60_0000_00)),
    (CanFrame(0x5FF, bytes.fromhex("6003600000000000")), ("reply", 127, 0x60_6003_00)),
    (CanFrame(0x600, bytes.fromhex("6003600000000000")), ("request", 0, 0x60_0000_00)),
    (wire.encode_upload_reply(0x25, 0x6003, 0, b"\1\2"), ("reply", 0x25, 0x4B_6003_00)),
    (wire.encode_download_reply(0x25, 0x6003, 1), ("reply", 0x25, 0x60_6003_01)),
    (wire.encode_abort_reply(1, 0x6003, 0, 1), ("reply", 1, 0x80_6003_00)),
    (wire.encode_segment_reply(1, 0, b"abc", True), ("reply", 1, 0x09_0000_00)),
    (encode_report(3, 100), ("notice", 3, 0x580)),
    (encode_report(3, 100, form="pdo"), ("notice", 3, 0x180)),
    (encode_alarm(3), ("notice", 3, 0x380)),
    (encode_boot(3), ("notice", 3, 0x700)),
    (CanFrame(0x083, bytes(8)), ("notice", 3, 0x080)),
    (CanFrame(ERROR_FLAG | 4, bytes(8)), ("notice", 0, ERROR_FLAG)),
    (encode_start("vendor", 3, True), ("request", 3, 0)),
    (encode_start("standard", 3, False), ("request", 3, 0)),
    (encode_start("standard", 0, True), ("request", 0, 0)),
    (CanFrame(0x625, bytes(7)), NOBODY),
    (CanFrame(0x625, b"\xff" + bytes(7)), NOBODY),
    (CanFrame(0x5A5, b"\xff" + bytes(7)), NOBODY),
    (CanFrame(0x580, bytes(8)), NOBODY),
    (CanFrame(0x583, b"\1\2\3\0"), NOBODY),
    (CanFrame(0x703, b"\x33"), NOBODY),
    (CanFrame(0x003, b"\x01\x01"), NOBODY),
    (CanFrame(0x625 | REMOTE_FLAG, b""), NOBODY),
    (CanFrame(0x123, b""), NOBODY),
]


@pytest.mark.parametrize(("frame", "told"), FRAMES, ids=lambda one: str(one))
def test_what_a_frame_is(frame: CanFrame, told: tuple[str, int, int]) -> None:
    recording = Recording()
    (run,) = recording.feed(frame)
    if told == NOBODY:
        assert run == Noise(frame.flat(), "foreign")
        assert [list(column) for column in recording.tell([])()] == [[], [], []]
    else:
        assert run == [frame.flat()]
        kind, node, code = (column[0] for column in recording.tell([frame.flat()])())
        assert (KINDS[kind], node, code) == told
    assert recording.flush() == []


def test_all_of_them_at_once() -> None:
    frames = [frame for frame, _ in FRAMES]
    found = bulk.frames_in(np, frames)
    assert found.start.tolist() == list(range(len(frames)))
    assert found.size.tolist() == [len(frame.flat()) for frame in frames]
    kinds = [KINDS[kind] for kind in found.kind.tolist()]
    assert list(zip(kinds, found.node.tolist(), found.code.tolist(), strict=True)) == [
        told for _, told in FRAMES
    ]
    faults = [FAULTS[fault] for fault in found.fault.tolist()]
    assert faults == ["foreign" if told == NOBODY else "" for _, told in FRAMES]


def test_what_looks_alike_is_told_apart() -> None:
    """Frames that differ in as little as can be, many of each."""
    chance = Random(20260122)
    bases = (0, 1, 0x080, 0x180, 0x380, 0x580, 0x600, 0x700, 0x123)
    frames = [
        CanFrame(
            chance.choice(bases) + chance.choice((0, 1, 2, 126, 127)) | chance.choice((0, 0, 0, ERROR_FLAG)),
            bytes(
                chance.choices(
                    (0, 0, 1, 2, 5, 0x40, 0x60, 0x80, 0xFF), k=chance.choice((0, 1, 2, 3, 4, 7, 8))
                )
            ),
            chance.random() < 0.3,
        )
        for _ in range(4000)
    ]
    frames += [
        CanFrame(0x605, bytes((first, second, *bytes(6)))) for first, second in ((0x80, 0x80), (0x81, 0))
    ]
    recording, told = Recording(), []
    for frame in frames:
        (run,) = recording.feed(frame)
        found = recording.tell(run)() if isinstance(run, list) else ([0], [-1], [-1])
        told.append(tuple(column[0] for column in found))
    at_once = bulk.frames_in(np, frames)
    assert list(zip(*(column.tolist() for column in at_once[2:5]), strict=True)) == told
    assert {kind for kind, _, _ in told} == {0, 1, 2, 4}


def test_frames_may_be_told_later() -> None:
    recording = Recording()
    sent = [frame for frame, told in FRAMES[:3] if recording.feed(frame)]
    assert [list(recording.tell([one.flat()])()[1]) for one in sent] == [[0x25], [0], [127]]
    assert [list(column) for column in recording.tell([])()] == [[], [], []]


def test_bytes_are_foreign() -> None:
    assert Recording().feed(b"\1") == [Noise(b"\1", "foreign")]
    assert (CAPTURES.cutter, CAPTURES.bulk) == (Recording, bulk.frames_in)
