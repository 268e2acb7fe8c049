"""A simulated controller with the real bus on it: driver and simulator, each judged by the bytes of the other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.core.steps import Runnable
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.simulator import Controller as SimulatedController
from motorbus.families.stepper.simulator import simulate
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate

T = TypeVar("T")


class Bench:
    """A simulated bus, the real bus on it, what was reported, and what was sent."""

    def __init__(
        self, *, line: Line | None = None, motor: int = 3, pace: bool = False, **options: Any
    ) -> None:
        self.simulator = simulate((1,), **options)
        self.link = MemoryLink(self.simulator, rate=9600, line=line, pace=pace)
        self.events: list[object] = []
        family = FAMILY.open(motor=motor, dump_order=options.get("dump_order", "little"))
        self.bus = Bus(self.link, family, interlock=Gate(), report=self.events.append)
        self.device = Controller(self.bus)
        self._trace = self.bus.trace.subscribe(limit=1_000_000)

    @property
    def simulated(self) -> SimulatedController:
        return self.simulator.nodes[1]

    def run(self, operation: Runnable[T]) -> T:
        return self.bus.run(operation)

    def press(self, request: str) -> None:
        """Let the controller have a request that this bus did not send, and swallow what it says to that."""
        self.simulator.receive(bytes.fromhex(request), self.link.now())
        self.simulator.advance(self.link.now() + 0.05)
        self.link.advance(0.06)

    def sent(self) -> list[str]:
        """Every request since this was last asked, in hexadecimal."""
        return [
            record.data.hex(" ").upper()
            for record in self._trace
            if record.direction == "tx" and isinstance(record.data, bytes)
        ]


@contextmanager
def bench(**options: Any) -> Iterator[Bench]:
    """A bench, closed at the end."""
    made = Bench(**options)
    try:
        yield made
    finally:
        made.bus.close()


class Tampering(PerfectLine):
    """Hands the so-many-th thing that the device says to `change`; an empty result is nothing."""

    def __init__(self) -> None:
        self.count = 0

    def change(self, data: bytes, number: int) -> bytes:
        return data

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST or not isinstance(data, bytes):
            return super().carry(sender, data, at)
        self.count += 1
        changed = self.change(data, self.count)
        return super().carry(sender, changed, at) if changed else []
