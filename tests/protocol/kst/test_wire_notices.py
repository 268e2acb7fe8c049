"""Reports, alarms, emergencies and heartbeats; starting and stopping them in both forms."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Notification
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo

NODES = st.sampled_from(sdo.NODES)


@given(NODES, st.integers(-0x8000, 0x7FFF), st.sampled_from(["sdo", "pdo"]), st.booleans())
def test_a_report_comes_out_as_it_went_in(node: int, raw: int, form: str, extended: bool) -> None:
    frame = notifications.encode_report(node, raw, form=form, extended=extended)
    assert frame.id == {"sdo": 0x580, "pdo": 0x180}[form] + node
    assert notifications.decode_notification(frame) == Notification(node, "report", frame.data)
    assert notifications.decode_report(frame.data) == raw


@given(NODES, st.binary(min_size=4, max_size=4))
def test_an_alarm_comes_out_as_it_went_in(node: int, data: bytes) -> None:
    frame = notifications.encode_alarm(node, data)
    assert notifications.decode_notification(frame) == Notification(node, "alarm", data)


def test_the_usual_alarm_is_low_voltage() -> None:
    assert notifications.encode_alarm(3) == CanFrame(0x383, b"\x0a\x02\0\0")


@given(st.sampled_from([0, *sdo.NODES]), st.booleans(), st.sampled_from(["vendor", "standard"]))
def test_a_start_comes_out_as_it_went_in(node: int, on: bool, form: str) -> None:
    start = notifications.decode_start(notifications.encode_start(form, node, on))
    assert start is not None
    assert form in start.forms
    assert (start.node, start.on) == (node, on)
    assert (len(start.forms) == 2) is (node == 0)


def test_the_two_forms_to_one_node_differ() -> None:
    assert notifications.encode_start("vendor", 5, on=True) == CanFrame(5, b"\x01\0")
    assert notifications.encode_start("standard", 5, on=False) == CanFrame(0, b"\x02\x05")


@pytest.mark.parametrize("data", [b"\x03\x05", b"\x01\x80", b"\x01", b"\x01\x05\0", b"\0\x05"])
def test_what_is_no_start(data: bytes) -> None:
    assert notifications.decode_start(CanFrame(0, data)) is None
    assert notifications.decode_start(CanFrame(5, data)) is None
    assert notifications.decode_start(CanFrame(5, b"\x01\x05")) is None


def test_every_state_of_a_heartbeat() -> None:
    known = [
        state
        for state in range(256)
        if notifications.decode_notification(CanFrame(0x701, bytes((state,)))) is not None
    ]
    assert known == [0, 4, 5, 0x7F, 0x80, 0x84, 0x85, 0xFF]


def test_every_identifier_by_its_length() -> None:
    lengths = {"report": 4, "alarm": 4, "emergency": 8, "heartbeat": 1}
    bases = {0x580: "report", 0x180: "report", 0x380: "alarm", 0x080: "emergency", 0x700: "heartbeat"}
    for identifier in range(0x800):
        for length in range(9):
            node, data = identifier & 0x7F, bytes(length)
            kind = bases.get(identifier - node, "") if node else ""
            expected = Notification(node, kind, data) if kind and lengths[kind] == length else None
            assert notifications.decode_notification(CanFrame(identifier, data)) == expected


@pytest.mark.parametrize("more", [b"\x01\0", b"\0\x01", b"\x60\0"])
def test_a_report_ends_with_two_zeros(more: bytes) -> None:
    assert notifications.decode_notification(CanFrame(0x581, b"\x84\x03" + more)) is None


def test_what_the_adapter_reports_is_of_no_node() -> None:
    data = bytes(8)
    assert notifications.decode_notification(CanFrame(ERROR_FLAG | 0x88, data)) == Notification(
        0, "bus error", data
    )
    assert notifications.decode_notification(CanFrame(REMOTE_FLAG | 0x701, b"\0")) is None


IMPOSSIBLE: dict[str, Callable[[], object]] = {
    "report of 0": lambda: notifications.encode_report(0, 0),
    "report of 128": lambda: notifications.encode_report(128, 0),
    "report in no form": lambda: notifications.encode_report(1, 0, form="tpdo"),
    "position beyond 16 bits": lambda: notifications.encode_report(1, 0x8000),
    "alarm of 2 bytes": lambda: notifications.encode_alarm(1, b"\x0a\x02"),
    "alarm of 0": lambda: notifications.encode_alarm(0),
    "start of 128": lambda: notifications.encode_start("vendor", 128, on=True),
    "start in no form": lambda: notifications.encode_start("nmt", 1, on=True),
}


@pytest.mark.parametrize("make", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_what_no_frame_can_carry_is_refused(make: Callable[[], object]) -> None:
    with pytest.raises(RequestError) as raised:
        make()
    assert raised.value.expected


@pytest.mark.parametrize(
    ("frame", "node"),
    [
        (sdo.encode_upload(0x25, 0x6002), 0x25),
        (CanFrame(0x625, b""), 0x25),  # what makes no sense is for it all the same
        (CanFrame(0x625, bytes(8), extended=True), 0x25),
        (CanFrame(REMOTE_FLAG | 0x625, b""), 0x25),
        (CanFrame(0x600, bytes(8)), sdo.BROADCAST),
        (notifications.encode_start("standard", 0x25, True), 0x25),
        (notifications.encode_start("standard", sdo.BROADCAST, False), sdo.BROADCAST),
        (notifications.encode_start("vendor", 0x25, True), 0x25),
        (CanFrame(0x5A5, bytes(8)), None),
        (CanFrame(0x680, bytes(8)), None),
        (CanFrame(0x025, bytes(8)), None),
        (CanFrame(0x000, b"\x81\x25"), None),
        (CanFrame(ERROR_FLAG | 0x625, bytes(8)), None),
    ],
)
def test_whom_a_frame_of_a_host_is_for(frame: CanFrame, node: int | None) -> None:
    assert notifications.addressee(frame) == node
