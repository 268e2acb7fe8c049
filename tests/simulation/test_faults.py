"""Scripted harm: exactly this byte, exactly this way, and a record of it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.operation import CanFrame
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Side
from motorbus.simulation.faults import Fault, ScriptedLine, parse

REPLY = bytes.fromhex("FF FF 01 02 00 FC")


def carried(line: ScriptedLine, data: bytes = REPLY, at: float = 1.0) -> list[tuple[float, str]]:
    """What the host gets of a reply, with how much later."""
    got = []
    for delivery in line.carry(Side.DEVICE, data, at):
        assert delivery.to is Side.HOST
        assert isinstance(delivery.data, bytes)
        got.append((round(delivery.at - at, 9), delivery.data.hex(" ").upper()))
    return got


def asked(script: str, exchange: int = 1) -> ScriptedLine:
    line = ScriptedLine(script)
    for _ in range(exchange):
        line.carry(Side.HOST, b"\x01\x02\x03", 0.5)
    return line


@pytest.mark.parametrize(
    ("action", "got"),
    [
        ("drop", [(0.0, "FF FF 01 00 FC")]),
        ("duplicate", [(0.0, "FF FF 01 02 02 00 FC")]),
        ("corrupt 80", [(0.0, "FF FF 01 82 00 FC")]),
        ("insert 00", [(0.0, "FF FF 01 00 02 00 FC")]),
        ("truncate", [(0.0, "FF FF 01")]),
        ("delay 0.02", [(0.0, "FF FF 01"), (0.02, "02 00 FC")]),
    ],
)
def test_each_harm_at_byte_3(action: str, got: list[tuple[float, str]]) -> None:
    line = asked(f"exchange 1 byte 3: {action}")
    assert carried(line) == got
    assert [(fired.at, fired.fault, fired.to, fired.data) for fired in line.fired] == [
        (1.0, f"exchange 1 byte 3: {action}", Side.HOST, REPLY)
    ]
    assert line.pending == ()
    assert carried(asked("", 2)) == [(0.0, "FF FF 01 02 00 FC")]


def test_only_its_own_exchange_suffers() -> None:
    line = ScriptedLine("exchange 2 byte 0: truncate")
    for exchange in (1, 2, 3):
        line.carry(Side.HOST, b"\x01", 0.0)
        assert carried(line) == ([] if exchange == 2 else [(0.0, "FF FF 01 02 00 FC")])
    assert line.exchange == 3


def test_toward_the_device() -> None:
    line = ScriptedLine("exchange 1 byte 1 to device: corrupt FF")
    assert line.carry(Side.HOST, b"\x01\x02\x03", 2.0) == [Delivery(2.0, Side.DEVICE, b"\x01\xfd\x03")]
    assert carried(line) == [(0.0, "FF FF 01 02 00 FC")]


def test_bytes_count_through_the_whole_exchange() -> None:
    line = asked("exchange 1 byte 7: drop")
    assert carried(line) == [(0.0, "FF FF 01 02 00 FC")]
    assert carried(line) == [(0.0, "FF 01 02 00 FC")]


def test_truncating_and_delaying_last_to_the_end_of_the_exchange() -> None:
    line = asked("exchange 1 byte 4: truncate")
    assert carried(line) == [(0.0, "FF FF 01 02")]
    assert carried(line) == []
    line = asked("exchange 1 byte 0: delay 0.5")
    assert carried(line) == carried(line) == [(0.5, "FF FF 01 02 00 FC")]
    line.carry(Side.HOST, b"\x01", 0.0)
    assert carried(line) == [(0.0, "FF FF 01 02 00 FC")]


def test_insert_behind_the_last_byte_happens_once() -> None:
    line = asked("exchange 1 byte 6: insert AA")
    assert carried(line) == [(0.0, "FF FF 01 02 00 FC AA")]
    assert carried(line) == [(0.0, "FF FF 01 02 00 FC")]


def test_other_harm_behind_the_last_byte_waits_for_a_byte() -> None:
    line = asked("exchange 1 byte 6: drop")
    assert carried(line) == [(0.0, "FF FF 01 02 00 FC")]
    assert len(line.pending) == 1


def test_several_on_one_byte_in_the_order_of_the_script() -> None:
    assert carried(asked("exchange 1 byte 5: corrupt 01; exchange 1 byte 5: duplicate")) == [
        (0.0, "FF FF 01 02 00 FD FD")
    ]
    assert carried(asked("exchange 1 byte 5: drop; exchange 1 byte 5: insert 11")) == [
        (0.0, "FF FF 01 02 00 11")
    ]
    assert carried(asked("exchange 1 byte 5: drop; exchange 1 byte 5: corrupt 11")) == [
        (0.0, "FF FF 01 02 00")
    ]


def test_the_same_fault_twice_happens_twice() -> None:
    line = asked("exchange 1 byte 0: insert 00; exchange 1 byte 0: insert 00")
    assert carried(line) == [(0.0, "00 00 FF FF 01 02 00 FC")]
    assert len(line.fired) == 2


def test_can_frames_are_carried_unharmed() -> None:
    line = asked("exchange 1 byte 0: drop")
    frame = CanFrame(0x581, b"\x01")
    assert line.carry(Side.DEVICE, frame, 1.0) == [Delivery(1.0, Side.HOST, frame)]


def test_a_script_is_lines_or_semicolons_with_remarks() -> None:
    script = """
        at exchange 17 byte 3: drop          # the id
        exchange 17 byte 0 to device: corrupt 80; exchange 18 byte 8 to host: delay 0.02
    """
    assert parse(script) == [
        Fault(17, 3, "drop"),
        Fault(17, 0, "corrupt", Side.DEVICE, value=0x80),
        Fault(18, 8, "delay", seconds=0.02),
    ]
    assert parse("") == []


@pytest.mark.parametrize(
    "line",
    [
        "drop",
        "exchange 1: drop",
        "exchange 1 byte 2: explode",
        "exchange 1 byte 2: drop 3",
        "exchange 1 byte 2: corrupt",
        "exchange 1 byte 2: corrupt 00",
        "exchange 1 byte 2: corrupt 100",
        "exchange 1 byte 2: insert xy",
        "exchange 1 byte 2: delay 0",
        "exchange 1 byte 2: delay nan",
        "exchange 1 byte 2: delay soon",
        "exchange 0 byte 2: drop",
        "exchange 1 byte 2 to nowhere: drop",
    ],
)
def test_nonsense_is_refused(line: str) -> None:
    with pytest.raises(RequestError, match="fault|is not"):
        parse(line)


faults = st.builds(
    Fault,
    st.integers(1, 1000),
    st.integers(0, 300),
    st.sampled_from(["drop", "duplicate", "truncate", "corrupt", "insert", "delay"]),
    st.sampled_from(Side),
    value=st.integers(1, 255),
    seconds=st.sampled_from([0.001, 0.25, 3.0]),
)


@given(st.lists(faults, max_size=5))
def test_a_printed_script_is_the_script(script: list[Fault]) -> None:
    text = str(ScriptedLine(script))
    assert str(ScriptedLine(text)) == text
    assert [str(fault) for fault in parse(text)] == [str(fault) for fault in script]


@given(st.lists(faults, max_size=20), st.lists(st.binary(min_size=1, max_size=20), max_size=10))
def test_what_is_not_due_is_carried_and_what_fired_is_not_pending(
    script: list[Fault], traffic: list[bytes]
) -> None:
    line = ScriptedLine(script)
    for data in traffic:
        line.carry(Side.HOST, data, 0.0)
        for delivery in line.carry(Side.DEVICE, data, 0.0):
            assert delivery.at >= 0.0
    assert len(line.fired) + len(line.pending) == len(script)
    assert all(fault.exchange <= len(traffic) for fault in script if fault not in line.pending)
