"""motorbus by its public calls: radians, safety gate and all checks included."""

from __future__ import annotations

import math
from typing import Any

import motorbus
from bench.measure import Contender, main
from bench.workloads import NODES
from motorbus import feetech

STEP = math.tau / 4096


class Motorbus(Contender):
    """Exchanges prepared once, as a control loop prepares them."""

    def __init__(self, port: str) -> None:
        self.bus = motorbus.open(f"feetech:{port},baud=1000000")
        servos = [feetech.Servo(self.bus, node) for node in NODES]
        for servo in servos:
            servo.prepare()
        self.first = servos[0]
        self.positions = feetech.ServoGroup(servos).positions
        self.goals = feetech.ServoGroup(servos).write("goal_position")

    def read(self) -> float:
        return self.first.position()

    def read_group(self) -> Any:
        return self.bus.run(self.positions)

    def write_group(self, goals: list[float]) -> None:
        self.bus.run(self.goals(goals))

    def prepare(self, goals: list[int]) -> list[float]:
        return [goal * STEP for goal in goals]

    def to_counts(self, values: Any) -> list[int]:
        found = [values] if isinstance(values, float) else [values.values[node] for node in NODES]
        return [round(value / STEP) for value in found]


if __name__ == "__main__":
    main(Motorbus)
