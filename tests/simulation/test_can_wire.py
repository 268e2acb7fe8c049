"""One CAN wire: bit time, arbitration, the adapter's delay and order; and how much of the wire a bus can fill."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from motorbus.core.can_bits import INTERFRAME, bits
from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.family import SimulatedNode
from motorbus.core.request import Data
from motorbus.link.memory import MemoryLink
from tests.support.can_wire import CanWire

RATE = 500_000
BIT = 1 / RATE
LATENCY = 0.0005


class Script:
    """Nodes that send what a test says, when it says, and keep what they hear."""

    def __init__(self, *sends: tuple[float, Data]) -> None:
        self.sends = list(sends)
        self.answers: list[CanFrame] = []
        self.heard: list[tuple[float, Data]] = []
        self.nodes: Mapping[int, SimulatedNode] = {}
        self.rate = 0

    def tune(self, rate: int) -> None:
        self.rate = rate

    def receive(self, data: Data, at: float) -> None:
        self.heard.append((at, data))
        self.sends += [(at, frame) for frame in self.answers]

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = [item for item in self.sends if item[0] <= to]
        self.sends = [item for item in self.sends if item[0] > to]
        return ready

    def due(self) -> float | None:
        return min((when for when, _ in self.sends), default=None)


def wire(*sends: tuple[float, Data], latency: float = LATENCY) -> tuple[CanWire, Script]:
    nodes = Script(*sends)
    made = CanWire(nodes, latency=latency)
    made.tune(RATE)
    return made, nodes


def frame(number: int, extended: bool = False) -> CanFrame:
    return CanFrame(number, bytes(8), extended)


def time_of(*frames: CanFrame) -> float:
    """From the first bit of the first to the last of the last, back to back."""
    return (sum(map(bits, frames)) - INTERFRAME) * BIT


def test_a_frame_of_the_host_takes_the_adapters_delay_and_its_bits() -> None:
    there, nodes = wire()
    there.receive(frame(0x625), 1.0)
    assert there.due() == 1.0 + LATENCY
    assert there.advance(2.0) == []
    ((at, heard),) = nodes.heard
    assert heard == frame(0x625)
    assert at == pytest.approx(1.0 + LATENCY + time_of(frame(0x625)))
    assert nodes.rate == RATE


def test_a_frame_of_a_node_takes_its_bits_and_the_adapters_delay() -> None:
    there, _ = wire((1.0, frame(0x5A5)))
    arrival = 1.0 + time_of(frame(0x5A5)) + LATENCY
    assert there.advance(arrival - 1e-9) == []
    assert there.due() == pytest.approx(arrival)
    ((at, heard),) = there.advance(arrival + 1e-9)
    assert heard == frame(0x5A5)
    assert at == pytest.approx(arrival)
    assert there.due() is None


def test_the_lowest_identifier_goes_first_when_the_wire_is_free() -> None:
    sends = [
        (0.0, frame(0x5FF)),
        (0.00001, frame(0x590)),
        (0.00002, frame(0x581)),
        (0.00003, frame(0x581 << 18, True)),
    ]
    there, _ = wire(*sends)
    order = [data for _, data in there.advance(1.0)]
    assert order == [sends[0][1], frame(0x581), frame(0x581 << 18, True), frame(0x590)], (
        "the first had begun already"
    )


def test_frames_follow_each_other_without_a_gap() -> None:
    sent = [frame(0x580 + node) for node in range(1, 6)]
    there, _ = wire(*((0.0, one) for one in sent))
    arrived = there.advance(1.0)
    expected = [time_of(*sent[: count + 1]) + LATENCY for count in range(5)]
    assert [at for at, _ in arrived] == pytest.approx(expected)
    assert there.busy == pytest.approx(sum(map(bits, sent)) * BIT)
    assert there.carried == 5


def test_the_adapter_keeps_its_order_and_competes_with_the_nodes() -> None:
    there, nodes = wire((LATENCY, frame(0x581)), (LATENCY, frame(0x7FF)))
    for number in (0x603, 0x601):
        there.receive(frame(number), 0.0)
    arrived = there.advance(1.0)
    assert [data for _, data in nodes.heard] == [frame(0x603), frame(0x601)]
    assert [data for _, data in arrived] == [frame(0x581), frame(0x7FF)]
    assert arrived[0][0] - LATENCY < nodes.heard[0][0] < nodes.heard[1][0] < arrived[1][0] - LATENCY


def test_a_reply_may_overtake_requests_that_still_wait() -> None:
    there, nodes = wire()
    nodes.answers = [frame(0x581)]
    there.receive(frame(0x601), 0.0)
    there.receive(frame(0x602), 0.0)
    (at, reply), *_ = there.advance(1.0)
    assert reply == frame(0x581)
    assert at == pytest.approx(LATENCY * 2 + time_of(frame(0x601), reply))
    assert nodes.heard[1][0] == pytest.approx(at - LATENCY + bits(frame(0x602)) * BIT)


def test_steps_of_any_size_give_the_same_moments() -> None:
    def moments(step: float) -> list[tuple[float, Data]]:
        there, nodes = wire(*((0.0001 * n, frame(0x5FF - n)) for n in range(50)))
        nodes.answers = []
        for n in range(20):
            there.receive(frame(0x601 + n), 0.0)
        found: list[tuple[float, Data]] = []
        now = 0.0
        while now < 0.1:
            now += step
            found += there.advance(now)
        return found + nodes.heard

    assert moments(0.1) == moments(0.00007) == moments(0.0013)


def test_a_report_of_a_bus_error_needs_no_wire() -> None:
    error = CanFrame(ERROR_FLAG | 4, bytes(8))
    there, _ = wire((1.0, error))
    assert there.advance(1.0 + LATENCY) == [(1.0 + LATENCY, error)]
    assert there.carried == 0


def test_a_memory_link_carries_it() -> None:
    there, nodes = wire()
    nodes.answers = [frame(0x5A5)]
    link = MemoryLink(there, rate=RATE)
    assert link.paced
    assert there.nodes is nodes.nodes
    link.write(frame(0x625))
    assert link.read(1.0) == [frame(0x5A5)]
    assert link.now() == pytest.approx(2 * LATENCY + time_of(frame(0x625), frame(0x5A5)))
