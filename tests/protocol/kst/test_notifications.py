"""Frames without a request, start and stop, and what a receiver makes of each frame of a bus."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Event, Noise, Notification, Reply
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.notifications import BusState, FrameReceiver
from tests.protocol.kst.vectors import INVALID, NOTIFICATIONS, REPLIES, REQUESTS, STARTS, VALID


def receive(frame: CanFrame, extended: bool = False) -> Event:
    """The event of a frame on a bus with this identifier format."""
    receiver = FrameReceiver(extended)
    (event,) = receiver.feed(frame)
    assert (receiver.held, receiver.flush()) == (0, [])
    return event


@pytest.mark.parametrize("node", [0, *sdo.NODES])
def test_start_is_decoded_as_encoded(node: int) -> None:
    """A standard start of all nodes is also a vendor one."""
    forms = frozenset(("vendor", "standard") if node == 0 else ("standard",))
    start = notifications.decode_start(notifications.encode_start(node))
    assert start == notifications.Start(forms, node, True)


def test_other_data_are_no_start() -> None:
    for data in (b"\x03\x05", b"\x01\x80", b"\x01", b"\x01\x05\0", b"\0\x05"):
        for identifier in (0, 5):
            assert notifications.decode_start(CanFrame(identifier, data)) is None
    assert notifications.decode_start(CanFrame(5, b"\x01\x05")) is None
    assert notifications.decode_start(CanFrame(REMOTE_FLAG | 5, b"\x01\0")) is None


@pytest.mark.parametrize("extended", [False, True])
def test_vectors_are_received(extended: bool) -> None:
    """Replies on the lane of their node, notifications, and frames of other hosts as noise."""
    for vector in VALID:
        frame = vector.frame._replace(extended=extended)
        event = receive(frame, extended)
        if vector in REPLIES:
            assert isinstance(event, Reply), vector.id
            assert (event.lane, event.data) == (vector.expected["node"], frame.data), vector.id
        elif vector in NOTIFICATIONS:
            assert event == Notification(vector.expected["node"], vector.kind, frame.data), vector.id
            raw = notifications.decode_report(frame.data)
            assert vector.kind != "report" or raw == vector.expected["raw"], vector.id
        else:
            assert event == Noise(frame.data, "foreign"), vector.id


def test_start_vectors_are_decoded() -> None:
    for vector in STARTS:
        node, on, forms = (vector.expected[name] for name in ("node", "on", "forms"))
        assert notifications.decode_start(vector.frame) == notifications.Start(frozenset(forms), node, on)
    assert [one.id for one in (*REQUESTS, *INVALID) if notifications.decode_start(one.frame)] == []


def test_identifier_and_length_give_the_kind() -> None:
    lengths = {"report": 4, "alarm": 4, "emergency": 8, "heartbeat": 1}
    bases = {0x580: "report", 0x180: "report", 0x380: "alarm", 0x080: "emergency", 0x700: "heartbeat"}
    for identifier in range(0x800):
        for length in range(9):
            node, data = identifier & 0x7F, bytes(length)
            kind = bases.get(identifier - node, "") if node else ""
            expected = Notification(node, kind, data) if kind and lengths[kind] == length else None
            assert notifications.decode_notification(CanFrame(identifier, data)) == expected


def test_heartbeat_has_a_state_and_report_ends_with_zeros() -> None:
    def is_known(identifier: int, data: bytes) -> bool:
        return notifications.decode_notification(CanFrame(identifier, data)) is not None

    states = [state for state in range(256) if is_known(0x701, bytes((state,)))]
    assert states == [0, 4, 5, 0x7F, 0x80, 0x84, 0x85, 0xFF]
    assert not any(is_known(0x581, b"\x84\x03" + rest) for rest in (b"\x01\0", b"\0\x01", b"\x60\0"))


def test_length_tells_a_reply_from_a_report_whatever_its_first_byte() -> None:
    for first in range(256):
        data = bytes((first, 2, 0x60, 0, 1, 2, 3, 4))
        event = receive(CanFrame(0x585, data))
        if sdo.decode_reply(data) is None:
            assert event == Noise(data, "foreign", 5)
        else:
            assert isinstance(event, Reply)
        report = bytes((first, 3, 0, 0))
        assert receive(CanFrame(0x585, report)) == Notification(5, "report", report)
        for length in (0, 1, 2, 3, 5, 6, 7):
            assert receive(CanFrame(0x585, data[:length])) == Noise(data[:length], "foreign")


@pytest.mark.parametrize("code", sdo.ABORTS, ids=hex)
def test_acknowledgement_with_an_abort_code_is_noise(code: int) -> None:
    """One changed digit in the text of an slcan adapter turns 80 into 60."""
    for wire in (code.to_bytes(4, "little"), code.to_bytes(4, "big")):
        assert isinstance(receive(CanFrame(0x585, b"\x80\x02\x60\x00" + wire)), Reply)
        changed = b"\x60\x02\x60\x00" + wire
        assert receive(CanFrame(0x585, changed)) == Noise(changed, "foreign", 5)
    for reserved in (bytes(4), b"\1\2\3\4", b"\xff\xff\xff\xff"):
        assert isinstance(receive(CanFrame(0x585, b"\x60\x02\x60\x00" + reserved)), Reply)


@pytest.mark.parametrize("expected", [False, True])
def test_receiver_accepts_one_identifier_format(expected: bool) -> None:
    for vector in (*REPLIES, *NOTIFICATIONS):
        for frame in (vector.frame, vector.frame._replace(extended=True)):
            is_noise = isinstance(receive(frame, expected), Noise)
            assert is_noise is (frame.extended is not expected), vector.id
        other = CanFrame(0x1000_0000 | vector.frame.id, vector.frame.data, True)
        remote = vector.frame._replace(id=REMOTE_FLAG | vector.frame.id, extended=expected)
        assert receive(other, expected) == receive(remote, expected) == Noise(other.data, "foreign")


def test_bytes_are_noise_and_bus_errors_have_no_node() -> None:
    assert FrameReceiver().feed(b"\xff\xff") == [Noise(b"\xff\xff", "foreign")]
    assert FrameReceiver().feed(b"") == []
    for extended in (False, True):
        frame = CanFrame(ERROR_FLAG | 0x80, bytes(8), extended)
        assert receive(frame) == Notification(0, "bus error", bytes(8))


ALARM = CanFrame(0x385, notifications.LOW_VOLTAGE)


def test_state_counts_boots() -> None:
    state = BusState()
    receiver = FrameReceiver(state=state)
    for text in ("705#00", "706#00", "705#05", "705#80", "705#0000", "585#4B02600000000000", "605#40"):
        number, _, data = text.partition("#")
        receiver.feed(CanFrame(int(number, 16), bytes.fromhex(data)))
    assert state.boots == {5: 2, 6: 1}


def test_state_shows_an_alarm_for_five_seconds_after_the_next_reply() -> None:
    state = BusState()
    receiver = FrameReceiver(state=state)
    assert state.alarm(5, -inf) == ()
    receiver.feed(ALARM)
    shown = [state.alarm(5, at) for at in (-inf, 10.0, 15.0, 15.1, 15.2)]
    assert shown == [("low voltage",)] * 3 + [()] * 2
    receiver.feed(ALARM._replace(data=b"\x0a\x01\0\0"))
    assert state.alarm(5, 16.0) == ("alarm 0A 01 00 00",)
    assert state.alarm(6, 16.0) == ()
