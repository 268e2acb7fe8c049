"""The budget of a CAN bus against the arithmetic of 16 servos, 243 bits a pair and adapters of known delay."""

from __future__ import annotations

from math import inf, nan

import pytest

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame
from motorbus.diagnose.budget import Budget, Span, Traffic, Transfer, budget
from motorbus.errors import RequestError

POSITIONS = range(-900, 901, 20)


def read(node: int) -> Transfer:
    """A read of an object of two bytes whose value is not known."""
    request = CanFrame(0x600 + node, bytes.fromhex("4002600000000000"))
    replies = [
        CanFrame(0x580 + node, b"\x4b\x02\x60\0" + raw.to_bytes(2, "little", signed=True) + bytes(2))
        for raw in POSITIONS
    ]
    return Transfer(node, ([request], replies), "read position")


def write(node: int) -> Transfer:
    orders = [
        CanFrame(0x600 + node, b"\x22\x03\x60\0" + raw.to_bytes(2, "little", signed=True) + bytes(2))
        for raw in POSITIONS
    ]
    return Transfer(node, (orders, [CanFrame(0x580 + node, bytes.fromhex("6003600000000000"))]), "move")


def servos(count: int, bitrate: int = 500_000, **options: float) -> Budget:
    return budget([read(node) for node in range(1, count + 1)], bitrate, **options)  # type: ignore[arg-type]


def test_every_frame_is_counted_to_the_bit() -> None:
    transfer = read(0x25)
    (cost,) = budget([transfer], 500_000).transfers
    request, replies = transfer.frames
    found = [bits(frame) for frame in replies]
    assert (cost.node, cost.name) == (0x25, "read position")
    assert cost.frames[0] == Span(bits(request[0]), bits(request[0]), bits(request[0]))
    assert (cost.frames[1].least, cost.frames[1].most) == (min(found), max(found))
    assert cost.frames[1].mean == pytest.approx(sum(found) / len(found))
    assert cost.bits.mean == cost.frames[0].mean + cost.frames[1].mean
    assert cost.time.mean == pytest.approx(cost.bits.mean / 500_000)


def test_the_loop_is_the_sum_of_its_transfers() -> None:
    found = servos(16)
    assert found.bits.mean == pytest.approx(sum(cost.bits.mean for cost in found.transfers))
    assert found.unstuffed == 16 * 222
    assert found.bits.least > found.unstuffed
    assert found.highest_rate.mean * 16 == pytest.approx(2057, rel=0.005)
    assert found.highest_rate.least < found.highest_rate.mean < found.highest_rate.most


def test_sixteen_servos_written_at_50_hz_take_39_percent_of_500k() -> None:
    found = budget([write(node) for node in range(1, 17)], 500_000, loop_rate=50)
    assert found.load.mean == pytest.approx(0.39, abs=0.002)
    assert found.fits()


def test_what_does_not_fit_says_so() -> None:
    found = servos(16, loop_rate=130)
    assert found.load.most > 1
    assert not found.fits()
    assert servos(16, loop_rate=found.highest_rate.least).fits()


@pytest.mark.parametrize(
    ("bitrate", "latency", "in_flight", "each"),
    [
        (500_000, 65e-6, 1.3, 1560),
        (500_000, 0.00025, 1.7, 1210),
        (500_000, 0.001, 3.3, 635),
        (500_000, 0.002, 5.4, 390),
        (1_000_000, 65e-6, 1.7, 2480),
        (1_000_000, 0.00025, 2.5, 1700),
        (1_000_000, 0.001, 5.6, 750),
        (1_000_000, 0.002, 9.8, 430),
    ],
)
def test_nodes_in_flight_for_an_adapter(bitrate: int, latency: float, in_flight: float, each: float) -> None:
    found = servos(4, bitrate, latency=latency, turnaround=0.0001)
    assert found.in_flight == pytest.approx(in_flight, rel=0.04)
    assert found.sequential_rate * 4 == pytest.approx(each, rel=0.03)


def test_reports_beside_the_loop_take_their_part() -> None:
    reports = Traffic([CanFrame(0x5A5, raw.to_bytes(2, "little") + bytes(2)) for raw in range(900)], 500.0)
    alone = servos(4, loop_rate=100)
    found = budget([read(node) for node in range(1, 5)], 500_000, loop_rate=100, besides=[reports])
    assert found.besides.mean == pytest.approx(500 * 85 / 500_000, rel=0.02)
    assert found.load.mean == pytest.approx(alone.load.mean + found.besides.mean)
    assert found.highest_rate.mean == pytest.approx(alone.highest_rate.mean * (1 - found.besides.mean))


def test_a_bus_full_of_other_traffic_has_no_room() -> None:
    found = budget([read(1)], 20_000, besides=[Traffic([CanFrame(1, bytes(8))], 1000.0)])
    assert found.highest_rate == Span(0.0, 0.0, 0.0)


def test_what_nobody_answers_waits_for_nothing() -> None:
    silent = Transfer(0, ([CanFrame(0x600, bytes(8))],))
    assert budget([silent], 500_000, latency=0.001).in_flight == 1.0
    assert budget([silent], 500_000).load == Span(0.0, 0.0, 0.0)


def test_what_cannot_be_counted_is_refused() -> None:
    for cycle in ([], [Transfer(1, ())], [Transfer(1, ([],))]):
        with pytest.raises(RequestError, match="no frame"):
            budget(cycle, 500_000)
    with pytest.raises(RequestError, match="bit rate"):
        budget([read(1)], 0)
    for options in ({"loop_rate": -1.0}, {"latency": nan}, {"turnaround": inf}):
        with pytest.raises(RequestError, match="cannot be"):
            budget([read(1)], 500_000, **options)  # type: ignore[arg-type]
