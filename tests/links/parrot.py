"""The simplest simulated bus."""

from __future__ import annotations

from collections.abc import Mapping

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import SimulatedNode
from motorbus.core.request import Data
from motorbus.link.memory import MemoryLink

DELAY = 0.001
PING = bytes.fromhex("ff ff 01 02 01 fb")


class Parrot:
    """A simulated bus that sends bytes back reversed after `delay` seconds, and a frame with its id plus one."""

    def __init__(self, delay: float = DELAY) -> None:
        self.delay = delay
        self.rate = 0
        self.received: list[tuple[float, Data]] = []
        self.coming: list[tuple[float, Data]] = []
        self.nodes: Mapping[int, SimulatedNode] = {}

    def receive(self, data: Data, at: float) -> None:
        self.received.append((at, data))
        said = data._replace(id=data.id + 1) if isinstance(data, CanFrame) else data[::-1]
        self.coming.append((at + self.delay, said))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = [item for item in self.coming if item[0] <= to]
        self.coming = [item for item in self.coming if item[0] > to]
        return ready

    def due(self) -> float | None:
        return min((when for when, _ in self.coming), default=None)

    def tune(self, rate: int, listen_only: bool = False) -> None:
        self.rate = rate


def drain(link: MemoryLink, seconds: float = 10.0) -> list[Data]:
    """Everything that arrives within this time."""
    end = link.now() + seconds
    arrived: list[Data] = []
    while link.now() < end:
        arrived += link.read(end)
    return arrived
