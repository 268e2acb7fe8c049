"""Six simulated servos on a line that can be made to lie, and an oracle that knows what is true at this moment."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from motorbus.core.request import Expected, Request, Response
from motorbus.families.feetech import FAMILY, protocol
from motorbus.families.feetech.simulator import FeetechBus
from motorbus.families.feetech.traits import TRAITS
from motorbus.link.base import Line, PerfectLine
from motorbus.link.memory import MemoryLink
from tests.support.world import make_bus

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
        self.bus = make_bus(self.link, FAMILY.open())

    def put(self, line: Line) -> None:
        """Another line between host and servos."""
        self.line = self.link.line = line

    def stir(self) -> int:
        """Give every servo a position it has not had lately; returns it."""
        self.count += 1
        raw = 17 + self.count * 7919 % (TRAITS[self.servos[1].model.table.name].turn - 96)
        for servo in self.servos.values():
            servo.raw_position = raw
        return raw

    def code(self, raw: int) -> bytes:
        """A word in the byte order of these servos."""
        return raw.to_bytes(2, "big" if self.model.startswith("scs") else "little")


def ping(rig: Rig) -> None:
    request: Request[Response] = Request(protocol.ping(1), (Expected(1, 1, 6),), repeatable=True)
    answer = rig.bus.run(request)
    assert answer.replies[0].data == protocol.frame(1, 0)
