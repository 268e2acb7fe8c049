"""Six simulated servos on a line that can be made to lie, and an oracle that knows what is true at this moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from motorbus.core.operation import Answer, Data, Due, Exchange
from motorbus.families.feetech import FAMILY, Servo, wire
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.simulator import FeetechBus
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.support.world import exclude_echo, make_bus

IDS = (1, 2, 3, 4, 5, 6)
FEEDBACK = 15  # bytes from 56 on


@dataclass
class Rig:
    """A bus, the servos at its end and a counter that makes every read have another right answer."""

    line: Line = field(default_factory=PerfectLine)
    options: dict[str, Any] = field(default_factory=dict)
    count: int = 0
    model: str = "sts3215"
    switches: dict[str, Any] = field(default_factory=dict)
    ids: tuple[int, ...] = IDS

    def __post_init__(self) -> None:
        self.simulator = FAMILY.simulator(self.ids, self.model, servo_baud=1_000_000, **self.switches)
        assert isinstance(self.simulator, FeetechBus)
        self.servos = self.simulator.nodes
        self.link = MemoryLink(self.simulator, line=self.line, **self.options)
        self.bus = make_bus(self.link, FAMILY)
        exclude_echo(self.bus)

    def put(self, line: Line) -> None:
        """Another line between host and servos."""
        self.line = self.link.line = line

    def stir(self) -> int:
        """Give every servo a position it has not had lately; returns it."""
        self.count += 1
        raw = 17 + self.count * 7919 % (self.servos[1].model.turn - 96)
        for servo in self.servos.values():
            servo.raw_position = raw
        return raw

    def code(self, raw: int) -> bytes:
        """A word in the byte order of these servos."""
        return raw.to_bytes(2, "big" if self.model.startswith("scs") else "little")


class Bytewise:
    """Hands over what another line delivers to the host byte by byte, as a slow wire does: none overtakes another."""

    def __init__(self, line: Line, gap: float = 1e-5) -> None:
        self.line = line
        self.gap = gap
        self._last = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return [piece for delivery in self.line.carry(sender, data, at) for piece in self._pieces(delivery)]

    def _pieces(self, delivery: Delivery) -> list[Delivery]:
        if delivery.to is Side.DEVICE or not isinstance(delivery.data, bytes):
            return [delivery]
        bytes_ = [delivery.data[index : index + 1] for index in range(len(delivery.data))]
        begin = max(delivery.at, self._last + self.gap)
        self._last = begin + (len(bytes_) - 1) * self.gap
        return [Delivery(begin + n * self.gap, delivery.to, byte) for n, byte in enumerate(bytes_)]


def words(answer: Answer) -> list[int]:
    """The first word of each reply."""
    return [int.from_bytes(reply.data[5:7], "little") for reply in answer.replies]


def ping(rig: Rig) -> None:
    exchange: Exchange[Answer] = Exchange(wire.ping(1), (Due(1, 1, 6),), repeatable=True)
    answer = rig.bus.run(exchange)
    assert answer.replies[0].data == wire.encode_status(1, 0)


def read_word(rig: Rig) -> None:
    """The driver's own READ of the position, raw."""
    raw = rig.stir()
    servo = Servo(rig.bus, 1)
    assert rig.bus.run(read_block(servo, 56, 2, lambda data: int.from_bytes(data, "little"))) == raw


def read_feedback(rig: Rig) -> None:
    raw = rig.stir()
    exchange: Exchange[Answer] = Exchange(
        wire.read(1, 56, FEEDBACK), (Due(1, 1, 6 + FEEDBACK),), repeatable=True
    )
    assert words(rig.bus.run(exchange)) == [raw]


def write_byte(rig: Rig) -> None:
    """Register 41, the acceleration: success must mean that it was written."""
    rig.count += 1
    value = rig.count % 250
    exchange: Exchange[Answer] = Exchange(wire.write(1, 41, bytes([value])), (Due(1, 1, 6),), repeatable=True)
    rig.bus.run(exchange)
    assert rig.servos[1].memory["acceleration"] == value


def sync_read(rig: Rig) -> None:
    """A node may be missing; one that is there is right."""
    raw = rig.stir()
    nodes = (1, 2, 3)
    exchange: Exchange[Answer] = Exchange(
        wire.sync_read(56, 2, nodes), tuple(Due(node, node, 8) for node in nodes), repeatable=True
    )
    answer = rig.bus.run(exchange)
    assert words(answer) == [raw] * (len(nodes) - len(answer.missing))
    if isinstance(rig.line, PerfectLine):
        assert answer.missing == ()


KINDS: dict[str, tuple[Callable[[Rig], None], int]] = {
    "ping": (ping, 6),
    "read 2 bytes": (read_word, 8),
    "read 15 bytes": (read_feedback, 21),
    "write": (write_byte, 6),
    "sync read 3 x 2 bytes": (sync_read, 24),
}
"""Each exchange with the bytes its replies have together; each asserts that what it got is true."""
