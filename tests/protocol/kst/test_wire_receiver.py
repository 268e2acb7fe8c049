"""What each frame is to a client: reply, notice or noise; told by identifier and length, never by the first byte."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Event, Noise, Notification, Reply
from motorbus.families.kst import notifications, sdo
from tests.protocol.kst.test_wire import FRAMES, NODES

FORMATS = st.booleans()


def heard(frame: CanFrame, extended: bool = False) -> Event:
    receiver = notifications.FrameReceiver(extended)
    (event,) = receiver.feed(frame)
    assert receiver.flush() == []
    return event


@given(FRAMES, FORMATS)
def test_every_frame_is_exactly_one_event_with_all_of_its_data(frame: CanFrame, extended: bool) -> None:
    assert heard(frame, extended).data == frame.data


@given(FRAMES, FORMATS)
def test_only_eight_bytes_from_a_node_in_an_expected_format_are_a_reply(
    frame: CanFrame, extended: bool
) -> None:
    event = heard(frame, extended)
    if isinstance(event, Reply):
        assert len(frame.data) == 8
        assert 0x581 <= frame.id <= 0x5FF
        assert frame.extended is extended
        assert event.lane == frame.id - 0x580
        assert sdo.decode_reply(frame.data) is not None


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("code", sdo.ABORTS)
def test_an_acknowledgement_with_the_code_of_a_refusal_was_a_refusal(code: int, order: Any) -> None:
    """One digit of an adapter's text makes 60 of 80."""
    refusal = b"\x80\x02\x60\x00" + code.to_bytes(4, order)
    changed = b"\x60" + refusal[1:]
    assert isinstance(heard(CanFrame(0x585, refusal)), Reply)
    assert heard(CanFrame(0x585, changed)) == Noise(changed, "foreign", 5)


@pytest.mark.parametrize("rest", [bytes(4), b"\1\2\3\4", b"\xff\xff\xff\xff", b"\2\0\1\7"])
def test_an_acknowledgement_with_anything_else_behind_it_is_one(rest: bytes) -> None:
    """CiA 301: what is reserved is ignored."""
    assert isinstance(heard(CanFrame(0x585, b"\x60\x02\x60\x00" + rest)), Reply)


def is_a_reply(specifier: int) -> bool:
    """Uploads and segments with whatever reserved bits, else an acknowledgement or an abort, whole."""
    return specifier < 0x20 or 0x40 <= specifier < 0x60 or specifier in (0x60, 0x80)


def test_every_first_byte_of_eight_bytes_from_a_node() -> None:
    for specifier in range(256):
        data = bytes((specifier, 2, 0x60, 0, 1, 2, 3, 4))
        event = heard(CanFrame(0x585, data))
        assert (sdo.decode_reply(data) is not None) is is_a_reply(specifier)
        if is_a_reply(specifier):
            assert isinstance(event, Reply)
            assert (event.lane, event.data) == (5, data)
        else:  # from that node's server, but no answer to anything
            assert event == Noise(data, "foreign", 5)


def test_every_first_byte_of_four_bytes_from_a_node() -> None:
    for low in range(256):
        for high in (0, 3, 0xFC):
            data = bytes((low, high, 0, 0))
            assert heard(CanFrame(0x585, data)) == Notification(5, "report", data)


@given(NODES, st.integers(-0x8000, 0x7FFF))
def test_a_report_is_never_a_reply(node: int, raw: int) -> None:
    frame = notifications.encode_report(node, raw)
    assert isinstance(heard(frame), Notification)
    assert sdo.decode_reply(frame.data) is None


@pytest.mark.parametrize("length", [0, 1, 2, 3, 5, 6, 7])
def test_no_other_length_is_anything_or_casts_doubt(length: int) -> None:
    for first in (0x00, 0x43, 0x4B, 0x60, 0x80):
        data = bytes((first, 2, 0x60, 0, 0, 0, 0))[:length]
        assert heard(CanFrame(0x585, data)) == Noise(data, "foreign")


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("expected", [False, True])
def test_only_an_expected_id_format_is_heard(extended: bool, expected: bool) -> None:
    reply = sdo.encode_upload_reply(5, 0x6002, 0, b"\0\0", extended=extended)
    report = notifications.encode_report(5, 0, extended=extended)
    alarm = notifications.encode_alarm(5, extended=extended)
    for frame, kind in ((reply, Reply), (report, Notification), (alarm, Notification)):
        event = heard(frame, expected)
        assert isinstance(event, kind if extended is expected else Noise)
        assert not isinstance(event, Noise) or event.fault == "foreign"


def test_identifiers_of_29_bits_that_end_like_ours_are_foreign() -> None:
    data = sdo.encode_upload_reply(5, 0x6002, 0, b"\0\0").data
    assert heard(CanFrame(0x1000_0585, data, extended=True), True) == Noise(data, "foreign")
    assert heard(CanFrame(0x0000_0D85, data, extended=True), True) == Noise(data, "foreign")


def test_a_remote_frame_is_foreign() -> None:
    for identifier in (0x585, 0x605, 0x705, 0x000):
        assert heard(CanFrame(REMOTE_FLAG | identifier, b"")) == Noise(b"", "foreign")
        assert heard(CanFrame(REMOTE_FLAG | identifier, bytes(8))) == Noise(bytes(8), "foreign")


@pytest.mark.parametrize("extended", [False, True])
def test_an_error_frame_is_a_notice_in_every_format(extended: bool) -> None:
    frame = CanFrame(ERROR_FLAG | 0x80, bytes(8), extended)
    assert heard(frame) == Notification(0, "bus error", bytes(8))


def test_our_own_requests_are_foreign() -> None:
    for frame in (
        sdo.encode_upload(5, 0x6002),
        sdo.encode_upload(0, 0x3000),
        sdo.encode_download(5, 0x6003, 0, b"\x60\x03"),
        sdo.encode_abort(5, 0x6003, 0, 0x0504_0000),
        notifications.encode_start("vendor", 5, on=True),
        notifications.encode_start("standard", 5, on=True),
    ):
        assert heard(frame) == Noise(frame.data, "foreign")


def test_bytes_are_not_for_this_bus() -> None:
    assert notifications.FrameReceiver().feed(b"\xff\xff") == [Noise(b"\xff\xff", "foreign")]
    assert notifications.FrameReceiver().feed(b"") == []
