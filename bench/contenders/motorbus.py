"""Ours, by its public calls: names, radians, the gate in place, everything checked that is always checked."""

from __future__ import annotations

import math
from time import monotonic
from typing import Any

import motorbus
from bench import memory
from bench.loop import main
from bench.workloads import COUNTS, IDS
from motorbus import feetech
from motorbus.bus.pump import Bus
from motorbus.core.operation import Data
from motorbus.motion.safety import Gate

STEP = math.tau / COUNTS
SPEED = 1000 * STEP


class MemoryLink:
    """A link without a kernel: what is written is answered at once."""

    def __init__(self) -> None:
        self.name = "memory"
        self.rate = 1_000_000
        self.latency = 0.0
        self.paced = False
        self.virtual = False
        self.simulated = True
        self.warnings: tuple[str, ...] = ()
        self.wire = memory.Wire()
        self.arrived: list[Data] = []

    def now(self) -> float:
        return monotonic()

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        answer = self.wire.answer(data)
        if answer:
            self.arrived.append(answer)

    def read(self, until: float) -> list[Data]:
        arrived, self.arrived = self.arrived, []
        return arrived

    def tune(self, rate: int, listen_only: bool = False) -> None:
        self.rate = rate

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        """Nothing is open."""


def _in_memory() -> Bus:
    """A bus as `motorbus.open` would leave it, after the test of the echo."""
    bus = Bus(MemoryLink(), feetech.FAMILY, admit=Gate())
    test = feetech.FAMILY.echo_test()
    bus.turns.expect_echo(test)
    bus.run(test)
    return bus


class Motorbus:
    """Servos are prepared once, prepared exchanges kept, as a control loop would."""

    def __init__(self, port: str) -> None:
        self.bus = _in_memory() if port == memory.PORT else motorbus.open(f"feetech:{port},baud=1000000")
        self.servos = [feetech.Servo(self.bus, node) for node in IDS]
        for servo in self.servos:
            servo.prepare()
        self.positions = feetech.sync_read_positions(self.servos)

    def read(self, prepared: Any) -> float:
        return self.servos[0].position()

    def sync_read(self, prepared: Any) -> feetech.Positions:
        return self.bus.run(self.positions)

    def sync_write(self, prepared: list[float]) -> None:
        orders: dict[feetech.Node, dict[str, float]] = {
            servo: {"goal_position": goal, "goal_time": 0.0, "goal_velocity": SPEED}
            for servo, goal in zip(self.servos, prepared, strict=True)
        }
        self.bus.run(feetech.sync_write(orders))

    def cycle(self, prepared: list[float]) -> feetech.Positions:
        self.bus.run(feetech.sync_write_positions(self.servos, prepared))
        return self.bus.run(self.positions)

    def prepare(self, counts: list[int]) -> list[float]:
        return [goal * STEP for goal in counts]

    def counts(self, values: float | feetech.Positions) -> list[int]:
        found = [values] if isinstance(values, float) else [values.values[node] for node in IDS]
        return [round(value / STEP) for value in found]

    def close(self) -> None:
        self.bus.close()


if __name__ == "__main__":
    main(Motorbus)
