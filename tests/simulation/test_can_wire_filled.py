"""How much of a CAN wire a bus fills, in virtual time with true bit time: KST servos behind an adapter of 1 ms.

Nothing here depends on the machine: the same figures come out everywhere. `make soak` prints the table.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest

from motorbus.bus.pump import Bus
from motorbus.core.operation import Operation, Together
from motorbus.diagnose.budget import Budget, Transfer, budget
from motorbus.families.kst import FAMILY, Servo
from motorbus.families.kst.driver.feedback import position_exchange
from motorbus.families.kst.simulator import KstBus
from motorbus.families.kst.wire import encode_upload, encode_upload_reply
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from motorbus.simulation.can_wire import CanWire

LATENCY = 0.001
TURNAROUND = 0.0001
POSITION = 0x6002
READS = 4000
COUNTS = (1, 2, 4, 8, 16)


class Filled(NamedTuple):
    """Reads per second of all nodes together, the time of a read that 99 in 100 keep (s), and the limits of both."""

    rate: float
    limit: float
    p99: float
    ideal: float

    @property
    def share(self) -> float:
        return self.rate / self.limit


def raw(node: int) -> int:
    """Where a servo stands: each elsewhere, all over the range."""
    return node * 377 % 1801 - 900


def counted(nodes: range, bitrate: int) -> Budget:
    """What the frames of these reads cost, to the bit."""
    cycle = [
        Transfer(
            node,
            (
                [encode_upload(node, POSITION)],
                [encode_upload_reply(node, POSITION, 0, raw(node).to_bytes(2, "little", signed=True))],
            ),
        )
        for node in nodes
    ]
    return budget(cycle, bitrate, latency=LATENCY, turnaround=TURNAROUND)


def measured(nodes: range, bitrate: int, reads: int) -> Filled:
    """Every node is read as fast as it answers, by one blocking bus."""
    simulator = FAMILY.simulator(tuple(nodes), "", turnaround=TURNAROUND, bit_rate=bitrate)
    assert isinstance(simulator, KstBus)
    for servo in simulator.servos:
        servo.raw_position = raw(servo.node)
    wire = CanWire(simulator, latency=LATENCY / 2)
    bus = Bus(MemoryLink(wire, rate=bitrate), FAMILY.configured(), admit=Gate())
    times: list[float] = []

    def reading(node: int) -> Operation[None]:
        servo = Servo(bus, node)
        exchange = position_exchange(servo)
        for _ in range(reads // len(nodes)):
            begun = bus.link.now()
            assert servo.table["present_position"].to_raw((yield from exchange)) == raw(node)
            times.append(bus.link.now() - begun)

    def together() -> Operation[None]:
        yield from Together([reading(node) for node in nodes])

    bus.run(together())
    assert all(ledger.sent == ledger.ok for ledger in bus.statistics.nodes.values())
    cost = counted(nodes, bitrate)
    full, alone = cost.highest_rate.mean, cost.sequential_rate * len(nodes)
    return Filled(
        rate=len(times) / bus.link.now(),
        limit=len(nodes) * min(full, alone),
        p99=sorted(times)[int(0.99 * len(times))],
        ideal=max(1 / full, 1 / alone),
    )


@pytest.mark.parametrize("bitrate", [500_000, 1_000_000])
def test_the_wire_is_full_from_eight_nodes_on(bitrate: int, rounds: Callable[[int], int]) -> None:
    found = {count: measured(range(1, 1 + count), bitrate, rounds(READS)) for count in COUNTS}
    print(f"\n{bitrate // 1000} kbit/s, adapter 1 ms there and back, servo 0.1 ms")
    for count, filled in found.items():
        print(
            f"| {count} | {filled.rate:.0f} | {filled.limit:.0f} | {filled.share:.1%} "
            f"| {filled.p99 * 1e3:.2f} ms | {filled.p99 / filled.ideal:.2f} |"
        )
    assert all(filled.share >= 0.95 for count, filled in found.items() if count >= 8)
    assert all(filled.share <= 1.02 for filled in found.values()), "no frame is shorter than it is"
    assert all(filled.p99 <= 1.2 * filled.ideal for filled in found.values())


def test_as_many_must_be_in_flight_as_the_budget_says() -> None:
    """Just below that number the wire has gaps, and a little above it is full."""
    needed = counted(range(1, 2), 1_000_000).in_flight
    assert 5 < needed < 6
    below = measured(range(1, 5), 1_000_000, READS)
    above = measured(range(1, 9), 1_000_000, READS)
    full = above.limit
    assert below.rate < 0.8 * full
    assert above.rate > 0.95 * full
