"""Every fault of the noisy line fires, does what its name says, and comes again with the same seed."""

from __future__ import annotations

import pytest

from motorbus.core.operation import CanFrame, Data
from motorbus.link.base import Delivery, Side
from motorbus.link.memory import MemoryLink, NoisyLine
from tests.links.parrot import PING, Parrot, drain

PROBABILITIES = ["loss", "duplicate", "corrupt", "lose_byte", "insert_byte", "double_byte", "late"]


def exchanges(line: NoisyLine, count: int = 200) -> list[tuple[float, list[Data]]]:
    """What comes back for so many requests, and when."""
    link = MemoryLink(Parrot(), line=line)
    told = []
    for number in range(count):
        link.write(bytes([number, 1, 2, 3]))
        arrived = link.read(link.now() + 0.01)
        told.append((link.now(), arrived))
    return told


@pytest.mark.parametrize("fault", PROBABILITIES)
def test_a_fault_fires_and_changes_what_arrives(fault: str) -> None:
    line = NoisyLine(1, **{fault: 0.1})  # type: ignore[arg-type]
    assert exchanges(line) != exchanges(NoisyLine(1))
    assert 5 <= line.count(fault) <= 40
    assert {fired.to for fired in line.fired} == {Side.HOST}


@pytest.mark.parametrize(
    ("fault", "possible"),
    [
        ("loss", [[]]),
        ("duplicate", [[b"abcd", b"abcd"]]),
        ("lose_byte", [[b"bcd"], [b"acd"], [b"abd"], [b"abc"]]),
        ("double_byte", [[b"aabcd"], [b"abbcd"], [b"abccd"], [b"abcdd"]]),
    ],
)
def test_what_a_fault_does(fault: str, possible: list[list[Data]]) -> None:
    line = NoisyLine(3, **{fault: 1.0})  # type: ignore[arg-type]
    seen = [[delivery.data for delivery in line.carry(Side.DEVICE, b"abcd", 0.0)] for _ in range(100)]
    assert all(arrived in possible for arrived in seen)
    assert all(arrived in seen for arrived in possible)


def test_corruption_changes_exactly_one_byte() -> None:
    line = NoisyLine(1, corrupt=1.0)
    for _ in range(500):
        [delivery] = line.carry(Side.DEVICE, b"abcd", 0.0)
        assert isinstance(delivery.data, bytes)
        assert sum(a != b for a, b in zip(delivery.data, b"abcd", strict=True)) == 1


def test_an_inserted_byte_is_one_more() -> None:
    line = NoisyLine(1, insert_byte=1.0)
    [delivery] = line.carry(Side.DEVICE, b"abcd", 0.0)
    assert isinstance(delivery.data, bytes)
    assert len(delivery.data) == 5


def test_a_frame_is_corrupted_in_its_data() -> None:
    line = NoisyLine(1, corrupt=1.0)
    [delivery] = line.carry(Side.DEVICE, CanFrame(5, b"\x00"), 0.0)
    assert isinstance(delivery.data, CanFrame)
    assert (delivery.data.id, delivery.data.data != b"\x00", len(delivery.data.data)) == (5, True, 1)


def test_a_frame_without_data_passes() -> None:
    line = NoisyLine(1, corrupt=1.0, lose_byte=1.0, split=True)
    assert [d.data for d in line.carry(Side.DEVICE, CanFrame(5, b""), 0.0)] == [CanFrame(5, b"")]
    assert line.fired == []


def test_a_late_packet_holds_up_what_follows() -> None:
    line = NoisyLine(1, late=1.0, late_by=(0.1, 0.2))
    [late] = line.carry(Side.DEVICE, b"late", 0.0)
    line.late = 0.0
    [next_one] = line.carry(Side.DEVICE, b"next", 0.05)
    assert 0.1 <= late.at <= 0.2
    assert next_one.at == late.at


def test_a_late_packet_can_be_overtaken() -> None:
    line = NoisyLine(1, late=1.0, late_by=(0.1, 0.2), overtake=True)
    [late] = line.carry(Side.DEVICE, b"late", 0.0)
    line.late = 0.0
    [next_one] = line.carry(Side.DEVICE, b"next", 0.05)
    assert 0.1 <= late.at <= 0.2
    assert next_one.at == 0.05


def test_delay_keeps_the_order() -> None:
    line = NoisyLine(1, delay=0.1)
    moments = [line.carry(Side.DEVICE, b"x", number * 0.001)[0].at for number in range(100)]
    assert moments == sorted(moments)
    assert line.count("delay") > 0


def test_the_host_hears_its_echo() -> None:
    line = NoisyLine(1, echo=True)
    link = MemoryLink(Parrot(), line=line)
    link.write(PING)
    assert drain(link) == [PING, PING[::-1]]
    assert line.count("echo") == 1


def test_the_echo_suffers_the_same_faults() -> None:
    line = NoisyLine(1, echo=True, loss=1.0)
    assert line.carry(Side.HOST, PING, 0.0) == [Delivery(0.0, Side.DEVICE, PING)]


def test_split_pieces_come_in_order_and_whole() -> None:
    line = NoisyLine(1, split=True)
    link = MemoryLink(Parrot(), line=line)
    for _ in range(50):
        link.write(PING)
        pieces = drain(link, 0.01)
        assert b"".join(piece for piece in pieces if isinstance(piece, bytes)) == PING[::-1]
    assert line.count("split") > 25


def test_faults_strike_the_side_they_are_meant_for() -> None:
    line = NoisyLine(1, loss=1.0, toward=Side.DEVICE)
    assert line.carry(Side.HOST, PING, 0.0) == []
    assert len(line.carry(Side.DEVICE, PING, 0.0)) == 1
    both = NoisyLine(1, loss=1.0, toward=None)
    assert both.carry(Side.HOST, PING, 0.0) + both.carry(Side.DEVICE, PING, 0.0) == []


def test_the_same_seed_gives_the_same_bytes_at_the_same_moments() -> None:
    def everything(seed: int) -> NoisyLine:
        return NoisyLine(
            seed,
            delay=0.002,
            loss=0.1,
            duplicate=0.1,
            corrupt=0.1,
            lose_byte=0.1,
            insert_byte=0.1,
            double_byte=0.1,
            late=0.1,
            echo=True,
            split=True,
            toward=None,
        )

    assert exchanges(everything(7)) == exchanges(everything(7))
    assert exchanges(everything(7)) != exchanges(everything(8))


def test_what_fired_says_when_and_what() -> None:
    line = NoisyLine(1, loss=1.0)
    line.carry(Side.DEVICE, b"abcd", 2.5)
    assert line.fired == [(2.5, "loss", Side.HOST, b"abcd")]
