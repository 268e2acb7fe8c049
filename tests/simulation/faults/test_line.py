"""Scripted harm: exactly this byte, exactly this way, and a record of it that does the same again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Delivery, Side
from motorbus.simulation.faults import WORDS, Fault, FaultyLine, Script
from motorbus.simulation.faults.line import BROKEN
from tests.simulation.faults.scripts import faults

REPLY = bytes.fromhex("FF FF 01 02 00 FC")
WHOLE = [(0.0, "FF FF 01 02 00 FC")]
FRAME = CanFrame(0x581, bytes.fromhex("43 03 60 00 11 22 33 44"))


def carried(line: FaultyLine, data: bytes = REPLY, at: float = 1.0) -> list[tuple[float, str]]:
    """What the host gets of a reply, with how much later."""
    got = []
    for delivery in line.carry(Side.DEVICE, data, at):
        assert delivery.to is Side.HOST
        assert isinstance(delivery.data, bytes)
        got.append((round(delivery.at - at, 9), delivery.data.hex(" ").upper()))
    return got


def asked(script: str, exchange: int = 1) -> FaultyLine:
    line = FaultyLine(script)
    for _ in range(exchange):
        line.carry(Side.HOST, b"\x01\x02\x03", 0.5)
    return line


@pytest.mark.parametrize(
    ("action", "got"),
    [
        ("drop", [(0.0, "FF FF 01 00 FC")]),
        ("duplicate", [(0.0, "FF FF 01 02 02 00 FC")]),
        ("corrupt 80", [(0.0, "FF FF 01 82 00 FC")]),
        ("flip 0", [(0.0, "FF FF 01 03 00 FC")]),
        ("insert 00", [(0.0, "FF FF 01 00 02 00 FC")]),
        ("truncate", [(0.0, "FF FF 01")]),
        ("delay 0.02", [(0.0, "FF FF 01"), (0.02, "02 00 FC")]),
        ("split", [(0.0, "FF FF 01"), (0.001, "02 00 FC")]),
        ("split 0.1", [(0.0, "FF FF 01"), (0.1, "02 00 FC")]),
    ],
)
def test_each_harm_at_byte_3(action: str, got: list[tuple[float, str]]) -> None:
    line = asked(f"exchange 1 byte 3: {action}")
    assert carried(line) == got
    assert [(fired.at, fired.fault, fired.to, fired.data) for fired in line.fired] == [
        (1.0, f"exchange 1 byte 3: {action}", Side.HOST, REPLY)
    ]
    assert line.pending == ()
    assert str(line.record) == f"exchange 1 byte 3: {action}"
    assert carried(asked("", 2)) == WHOLE


@pytest.mark.parametrize(
    ("action", "first", "second"),
    [
        ("drop", [], WHOLE),
        ("duplicate", WHOLE * 2, WHOLE),
        ("delay 0.02", [(0.02, "FF FF 01 02 00 FC")], [(0.02, "FF FF 01 02 00 FC")]),
        (
            "split",
            [(i / 1000, byte) for i, byte in enumerate(["FF", "FF", "01", "02", "00", "FC"])],
            [(0.005, WHOLE[0][1])],
        ),
    ],
)
def test_each_harm_to_a_packet(
    action: str, first: list[tuple[float, str]], second: list[tuple[float, str]]
) -> None:
    line = asked(f"exchange 1: {action}")
    assert carried(line) == first
    assert carried(line) == second
    assert carried(line, at=9.0) == WHOLE
    assert str(line.record) == f"exchange 1: {action}"


def test_an_echo_comes_to_the_host_and_does_not_count() -> None:
    line = FaultyLine("exchange 1: echo; exchange 2: echo 2; exchange 2 byte 5: drop")
    assert line.carry(Side.HOST, b"\x01\x02\x03", 0.0) == [
        Delivery(0.0, Side.HOST, b"\x01\x02\x03"),
        Delivery(0.0, Side.DEVICE, b"\x01\x02\x03"),
    ]
    assert line.carry(Side.HOST, b"\x01\x02\x03", 0.0)[0] == Delivery(0.0, Side.HOST, b"\x01\x02")
    assert carried(line) == [(0.0, "FF FF 01 02 00")]


def test_the_nth_packet_of_an_exchange() -> None:
    line = asked("exchange 1 packet 2: drop")
    assert [carried(line), carried(line), carried(line)] == [WHOLE, [], WHOLE]


def test_only_its_own_exchange_suffers() -> None:
    line = FaultyLine("exchange 2 byte 0: truncate")
    for exchange in (1, 2, 3):
        line.carry(Side.HOST, b"\x01", 0.0)
        assert carried(line) == ([] if exchange == 2 else WHOLE)
    assert line.exchange == 3


def test_toward_the_device() -> None:
    line = FaultyLine("exchange 1 byte 1 to device: corrupt FF")
    assert line.carry(Side.HOST, b"\x01\x02\x03", 2.0) == [Delivery(2.0, Side.DEVICE, b"\x01\xfd\x03")]
    assert carried(line) == WHOLE


@pytest.mark.parametrize(
    ("script", "got"),
    [
        ("exchange 1 byte 5: corrupt 01; exchange 1 byte 5: duplicate", "FF FF 01 02 00 FD FD"),
        ("exchange 1 byte 5: drop; exchange 1 byte 5: insert 11", "FF FF 01 02 00 11"),
        ("exchange 1 byte 5: drop; exchange 1 byte 5: corrupt 11", "FF FF 01 02 00"),
        ("exchange 1 byte 4: insert 11; exchange 1 byte 2: drop", "FF FF 02 11 00 FC"),
    ],
)
def test_several_at_once_in_the_order_of_the_bytes_and_of_the_script(script: str, got: str) -> None:
    line = asked(script)
    assert carried(line) == [(0.0, got)]
    assert len(line.fired) == 2


@pytest.mark.parametrize(
    ("script", "got"),
    [
        ("exchange 1: drop", []),
        ("exchange 1: duplicate", [FRAME, FRAME]),
        ("exchange 1: split", [FRAME]),
        ("exchange 1: corrupt", [BROKEN]),
        ("exchange 1: flip", [BROKEN]),
        ("exchange 1 byte 4: corrupt FF", [FRAME._replace(data=bytes.fromhex("43 03 60 00 EE 22 33 44"))]),
        ("exchange 1 byte 4: drop", [FRAME._replace(data=bytes.fromhex("43 03 60 00 22 33 44"))]),
        ("exchange 1 byte 4: insert 77", [FRAME._replace(data=bytes.fromhex("43 03 60 00 77 11 22 33"))]),
        ("exchange 1 byte 4: truncate", [FRAME._replace(data=bytes.fromhex("43 03 60 00"))]),
        ("exchange 1 byte 8: drop", [FRAME]),
    ],
)
def test_of_a_can_frame_the_data_bytes_count(script: str, got: list[CanFrame]) -> None:
    line = FaultyLine(script)
    assert line.carry(Side.HOST, FRAME, 0.0) == [Delivery(0.0, Side.DEVICE, FRAME)]
    assert line.carry(Side.DEVICE, FRAME, 1.0) == [Delivery(1.0, Side.HOST, frame) for frame in got]


def test_at_a_moment_it_is_the_first_packet_from_then_on() -> None:
    line = FaultyLine("at 2.5 s: drop")
    line.carry(Side.HOST, b"\x01", 0.0)
    assert carried(line, at=2.4) == WHOLE
    assert len(line.pending) == 1
    assert carried(line, at=2.6) == []
    assert carried(line, at=2.7) == WHOLE
    assert str(line.record) == "exchange 1 packet 2: drop"


def test_one_in_a_hundred_is_about_that_many_and_another_seed_takes_others() -> None:
    struck = []
    for seed in (1, 2):
        line = FaultyLine(f"seed {seed}; 1% of bytes: corrupt; 2%: delay 0.02-0.5; 3% to device: drop")
        for exchange in range(4000):
            line.carry(Side.HOST, b"\x01\x02", float(exchange))
            line.carry(Side.DEVICE, REPLY, float(exchange))
        assert 180 < line.counts["corrupt"] < 300
        assert 50 < line.counts["delay"] < 115
        assert 85 < line.counts["drop"] < 160
        assert line.count == len(line.fired) == len(line.record)
        struck.append(str(line.record))
    assert struck[0] != struck[1]


def test_every_packet_at_a_hundred_percent() -> None:
    line = FaultyLine("100%: duplicate")
    line.carry(Side.HOST, b"\x01", 0.0)
    assert carried(line) == carried(line) == WHOLE * 2


WIRE = [name for name, word in WORDS.items() if not word.world]
FRAMES = st.builds(CanFrame, st.integers(0, 0x7FF), st.binary(max_size=8))
TRAFFIC = st.lists(st.tuples(st.sampled_from(Side), st.floats(0, 3)), max_size=20)


def passed(line: FaultyLine, traffic: list[tuple[Side, Data, float]]) -> list[Delivery]:
    now, got = 0.0, []
    for sender, data, pause in traffic:
        now += pause
        got += line.carry(sender, data, now)
    return got


@given(
    st.lists(faults(*WIRE), max_size=6),
    st.integers(0, 1000),
    TRAFFIC,
    st.data(),
)
def test_the_record_does_the_same_again(
    script: list[Fault], seed: int, course: list[tuple[Side, float]], data: st.DataObject
) -> None:
    kind: st.SearchStrategy[Data] = data.draw(st.sampled_from([FRAMES, st.binary(min_size=1, max_size=12)]))
    traffic = [(sender, data.draw(kind), pause) for sender, pause in course]
    line = FaultyLine(Script(tuple(script), seed))
    got = passed(line, traffic)
    again = FaultyLine(str(line.record))
    assert passed(again, traffic) == got
    assert str(again.record) == str(line.record)
    assert passed(FaultyLine(str(line)), traffic) == got
    assert len(again.fired) == line.count == len(line.fired)


@given(st.lists(faults(*WIRE), max_size=20), st.lists(st.binary(min_size=1, max_size=20), max_size=10))
def test_what_has_a_place_fires_once_or_is_pending(script: list[Fault], traffic: list[bytes]) -> None:
    placed = [fault for fault in script if not fault.percent]
    line = FaultyLine(placed)
    for data in traffic:
        line.carry(Side.HOST, data, 0.0)
        for delivery in line.carry(Side.DEVICE, data, 0.0):
            assert delivery.at >= 0.0
    assert len(line.fired) + len(line.pending) == len(placed)
    assert all((fault.exchange or 0) <= len(traffic) for fault in placed if fault not in line.pending)
