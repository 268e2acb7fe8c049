"""The words for reports, alarms, starts, CANopen's own frames, error frames and frames of nobody."""

from __future__ import annotations

import pytest
from hypothesis import given

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.families.kst import wire
from motorbus.families.kst.phrases import Told
from motorbus.families.kst.table import PROFILES
from motorbus.families.kst.unasked import unasked
from tests.protocol.kst.test_wire import FRAMES


def told(frame: CanFrame, profile: str = "kst") -> Told:
    return unasked(frame, PROFILES[profile])


@given(FRAMES)
def test_every_byte_of_every_frame_has_words(frame: CanFrame) -> None:
    said = told(frame)
    assert sum(size for size, _, _ in said.fields) == len(frame.data)
    assert said.title
    assert said.identifier


def test_a_report_is_told_in_degrees_as_the_profile_counts() -> None:
    assert told(wire.encode_report(3, -109)).title == "report of node 3: -10.9° (raw -109, 10 per degree)"
    assert (
        told(wire.encode_report(3, 180), "xqpower").title == "report of node 3: 10° (raw 180, 18 per degree)"
    )
    assert told(wire.encode_report(3, 0)).identifier == "report of node 3 (0x580 + 3), 11 bits"
    form = wire.encode_report(3, 0, form="pdo", extended=True)
    assert told(form).identifier == "report of node 3 (0x180 + 3), 29 bits"


@pytest.mark.parametrize(
    ("identifier", "data", "title"),
    [
        (0x383, "0A 02 00 00", "alarm of node 3: low voltage"),
        (0x383, "0A 01 00 00", "alarm of node 3: not known (0A 01 00 00)"),
        (0x083, "20 31 04 00 00 00 00 00", "emergency of node 3: 0x3120, voltage"),
        (0x083, "00 A0 00 00 00 00 00 00", "emergency of node 3: 0xA000, not known"),
        (0x703, "00", "heartbeat of node 3: boot-up"),
        (0x703, "85", "heartbeat of node 3: operational, toggle bit of node guarding set"),
        (0x003, "01 00", "to node 3: start, in the vendor form"),
        (0x000, "02 03", "to node 3: stop, in the standard form"),
        (0x000, "01 00", "to everyone: start, in either form"),
        (0x000, "80 03", "to node 3: be pre-operational"),
        (0x000, "81 03", "to node 3: restart"),
        (0x000, "82 00", "to everyone: restart communication"),
    ],
)
def test_what_a_frame_is_called(identifier: int, data: str, title: str) -> None:
    said = told(CanFrame(identifier, bytes.fromhex(data)))
    assert (said.title, said.fault) == (title, "")


def test_the_bits_of_the_error_register_are_named() -> None:
    fields = told(CanFrame(0x081, bytes.fromhex("0010 81 0000000000"))).fields
    assert fields[1] == (1, "error register", "0x81: generic, vendor")
    assert told(CanFrame(0x081, bytes(8))).fields[1][2] == "0x00: no error"


@pytest.mark.parametrize(
    ("frame", "fault"),
    [
        (CanFrame(0x581, b"\x84\x03\x01\0"), "a report is a position (2 bytes) and two zeros"),
        (CanFrame(0x181, b"\x84\x03"), "a report is a position (2 bytes) and two zeros"),
        (CanFrame(0x381, b"\x0a\x02"), "an alarm has 4 data bytes"),
        (CanFrame(0x081, bytes(7)), "an emergency has 8 data bytes"),
        (CanFrame(0x701, b"\x01"), "a heartbeat is one byte"),
        (CanFrame(0x000, b"\x03\x05"), "no command of network management"),
        (CanFrame(0x000, b"\x81\x80"), "no command of network management"),
        (CanFrame(0x005, b"\x01\x05"), "under a node's own number"),
        (CanFrame(0x080, b""), "no frame of this protocol"),
        (CanFrame(0x7E5, bytes(8)), "no frame of this protocol"),
        (CanFrame(0x1000_0701, b"\0", extended=True), "no frame of this protocol"),
        (CanFrame(0x1701, b"\0"), "does not fit 11 bits"),
        (CanFrame(REMOTE_FLAG | 0x701, b""), "a remote frame"),
        (CanFrame(ERROR_FLAG | 0x20, bytes(8)), "the adapter reports nobody acknowledged"),
        (CanFrame(ERROR_FLAG | 0xC0, bytes(8)), "the adapter reports bus off, a bus error"),
        (CanFrame(ERROR_FLAG, b""), "the adapter reports an error on the bus"),
    ],
    ids=str,
)
def test_why_a_frame_is_bad(frame: CanFrame, fault: str) -> None:
    assert fault in told(frame).fault
