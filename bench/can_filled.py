"""How much of a CAN wire a bus fills, in virtual time with true bit time: KST servos behind an adapter of 1 ms.

Nothing here depends on the machine: the same figures come out everywhere. The limit is counted to the bit from these
very frames, and is the lesser of a full wire and of nodes that never wait for each other.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from bench.rounds import Failed
from motorbus import kst
from motorbus.bus.blocking import Bus
from motorbus.core.steps import gather
from motorbus.diagnose.budget import Budget, Transfer, budget
from motorbus.families.kst.sdo import encode_upload, encode_upload_reply
from motorbus.families.kst.simulator import KstBus
from motorbus.families.kst.simulator.server import TURNAROUND
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.support.can_wire import CanWire

LATENCY: Final = 0.001
"""s; there and back, a pure delay."""
POSITION: Final = 0x6002


class Filled(NamedTuple):
    """Reads per second of all nodes together, the time of a read that 99 in 100 keep (s), and the limits of both."""

    rate: float
    limit: float
    p99: float
    ideal: float

    @property
    def share(self) -> float:
        return self.rate / self.limit


class WrongValue(Failed):
    """A servo was said to stand where it does not, or an exchange failed."""


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
    """Every node is read as fast as it answers, by one blocking bus. Raises WrongValue."""
    simulator = kst.FAMILY.simulator(tuple(nodes), "", bit_rate=bitrate)
    assert isinstance(simulator, KstBus)
    for servo in simulator.servos:
        servo.raw_position = raw(servo.node)
    wire = CanWire(simulator, latency=LATENCY / 2)
    bus = Bus(MemoryLink(wire, rate=bitrate), kst.FAMILY.open(), interlock=Gate())
    times: list[float] = []

    async def reading(node: int) -> None:
        servo, position = kst.Servo(bus, node), kst.Servo.position.function
        for _ in range(reads // len(nodes)):
            begun = bus.link.now()
            found = servo.table["present_position"].to_raw(await position(servo))
            if found != raw(node):
                raise WrongValue(f"node {node} stands at {raw(node)}, and was read as {found}")
            times.append(bus.link.now() - begun)

    async def together() -> None:
        await gather(*[reading(node) for node in nodes])

    bus.run(together())
    if any(ledger.sent != ledger.ok for ledger in bus.statistics.nodes.values()):
        raise WrongValue("not every request was answered")
    cost = counted(nodes, bitrate)
    full, alone = cost.highest_rate.mean, cost.sequential_rate * len(nodes)
    return Filled(
        rate=len(times) / bus.link.now(),
        limit=len(nodes) * min(full, alone),
        p99=sorted(times)[int(0.99 * len(times))],
        ideal=max(1 / full, 1 / alone),
    )
