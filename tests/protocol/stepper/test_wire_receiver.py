"""The receive state machine: by length, never by pattern; notices at any moment; every byte in exactly one event."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Event, Noise, Notification, Reply
from motorbus.families.stepper import wire
from tests.protocol.stepper.vectors import DUMP_B, REPLIES, behaviour

STREAMS = behaviour("streams")
KINDS = {"reply": Reply, "notice": Notification, "noise": Noise}
PIECES = st.sampled_from([vector.data for vector in REPLIES if len(vector.data) == 6] + [DUMP_B, wire.NOTICE])


def joined(events: list[Event]) -> list[tuple[type, bytes]]:
    """What came, with noise that was told in pieces put together."""
    told: list[tuple[type, bytes]] = []
    for event in events:
        if told and told[-1][0] is Noise and isinstance(event, Noise):
            told[-1] = Noise, told[-1][1] + event.data
        else:
            told.append((type(event), event.data))
    return told


def fed(stream: dict[str, Any], size: int) -> list[Event]:
    receiver = wire.Receiver()
    events: list[Event] = []
    for piece in stream["pieces"]:
        data = bytes.fromhex(piece["hex"])
        for at in range(0, len(data), size):
            events += receiver.feed(data[at : at + size], piece["at"] + at * 0.00104)
    return events + receiver.flush()


@pytest.mark.parametrize("size", [1, 2, 3, 7, 300])
@pytest.mark.parametrize("stream", STREAMS, ids=lambda stream: stream["id"])
def test_a_stream_is_the_same_however_it_is_cut(stream: dict[str, Any], size: int) -> None:
    wanted = [(KINDS[one["kind"]], bytes.fromhex(one["hex"])) for one in stream["events"]]
    assert joined(fed(stream, size)) == wanted


def test_without_times_only_a_flush_ends_what_has_begun() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(DUMP_B[:100]) == []
    assert receiver.held == 100
    assert receiver.feed(wire.NOTICE) == []  # by length: it may be data
    assert receiver.flush() == [Noise(DUMP_B[:100] + wire.NOTICE, "framing")]
    assert receiver.flush() == []


@pytest.mark.parametrize(("pause", "whole"), [(0.049, True), (0.051, False)])
def test_a_pause_ends_what_has_begun(pause: float, whole: bool) -> None:
    receiver = wire.Receiver()
    reply = bytes.fromhex("FFAA030D0000")
    receiver.feed(reply[:3], 10.0)
    events = receiver.feed(reply[3:], 10.0 + pause)
    assert ([type(event) for event in events] == [Reply]) is whole
    assert b"".join(event.data for event in events + receiver.flush()) == reply


def test_a_pause_between_two_things_is_nothing() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(wire.NOTICE, 0.0) == [Notification(1, "completed", wire.NOTICE)]
    assert receiver.feed(wire.NOTICE, 3600.0) == [Notification(1, "completed", wire.NOTICE)]


def test_no_bytes_are_no_sign_of_life() -> None:
    receiver = wire.Receiver()
    receiver.feed(b"\xff", 0.0)
    assert receiver.feed(b"", 0.04) == []
    assert receiver.feed(b"\xaa", 0.06) == [Noise(b"\xff", "framing"), Noise(b"\xaa", "framing")]


def test_a_notice_in_the_payload_of_a_dump_is_none() -> None:
    assert wire.NOTICE in DUMP_B
    assert wire.HEADER in DUMP_B[2:]
    receiver = wire.Receiver()
    assert [type(event) for event in receiver.feed(wire.NOTICE + DUMP_B + wire.NOTICE)] == [
        Notification,
        Reply,
        Notification,
    ]


def test_a_damaged_dump_is_never_searched() -> None:
    """One byte lost: what follows fills it up, and nothing in it becomes a reply or a notice."""
    receiver = wire.Receiver()
    short = DUMP_B[:60] + DUMP_B[61:]
    assert receiver.feed(short) == []
    (event,) = receiver.feed(b"\0")
    assert isinstance(event, Reply)
    assert event.data == short + b"\0"


def test_the_node_is_told_in_a_notice() -> None:
    assert wire.Receiver(7).feed(wire.NOTICE) == [Notification(7, "completed", wire.NOTICE)]


def test_a_can_frame_is_foreign() -> None:
    assert wire.Receiver().feed(CanFrame(1, b"\xff\xaa")) == [Noise(b"\xff\xaa", "foreign")]


@given(st.lists(st.one_of(PIECES, st.binary(max_size=8))), st.data())
def test_every_byte_comes_out_in_exactly_one_event(pieces: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(pieces)
    receiver = wire.Receiver()
    events: list[Event] = []
    at = 0
    while at < len(stream):
        size = data.draw(st.integers(1, 40))
        events += receiver.feed(stream[at : at + size])
        assert receiver.held <= 225
        at += size
    events += receiver.flush()
    assert b"".join(event.data for event in events) == stream
    assert joined(events) == joined((whole := wire.Receiver()).feed(stream) + whole.flush())


@given(st.lists(PIECES))
def test_what_is_in_step_stays_in_step(pieces: list[bytes]) -> None:
    receiver = wire.Receiver()
    events = receiver.feed(b"".join(pieces))
    assert [event.data for event in events] == pieces
    assert {type(event) for event in events} <= {Reply, Notification}
