"""servolab 1.0.0: SI units, one message for all; used as its documentation shows it.

Its scan reads positions, which the books of the responder would count, so the motors are named here instead.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

from bench import memory
from bench.contenders.sdk_port import MemoryPort
from bench.loop import main
from bench.workloads import COUNTS, Fields, Workload

servolab: Any = import_module("servolab")  # it is in a folder of its own, where no type checker looks
feetech_port: Any = import_module("servolab.ports.feetech_port")

STEP = math.tau / COUNTS
MIDDLE = COUNTS // 2
POSITION, SIZE = 56, 15
SPEED = 1000


class Servolab:
    """Radians from the middle of the turn; `read_feedback` brings every quantity of every motor."""

    def __init__(self, port: str, workload: Workload) -> None:
        if port == memory.PORT:
            feetech_port._sdk.PortHandler = lambda name: MemoryPort(workload)
        self.bus = servolab.connect(port, scan=False)
        self.nodes = list(workload.reads or workload.writes)
        for node in workload.nodes:
            self.bus.motors[node] = servolab.Motor(self.bus, node, "STS3215")
            self.bus.motors[node].update_mode()

    def read(self, prepared: Any) -> float:
        return float(self.bus[1].position)

    def fields(self, prepared: Any) -> Any:
        return self.bus.read_feedback()

    def blocks(self, prepared: Any) -> Any:
        return self.bus.port.sync_read(self.nodes, POSITION, SIZE)

    def sync_write(self, prepared: list[dict[str, int]]) -> None:
        self.bus.sync_write_registers(dict(zip(self.nodes, prepared, strict=True)))

    def prepare(self, counts: list[int]) -> list[dict[str, int]]:
        return [{"goal_position": goal, "goal_time": 0, "goal_velocity": SPEED} for goal in counts]

    def counts(self, values: Any) -> list[Any]:
        if isinstance(values, float):
            return [round(values / STEP) + MIDDLE]
        if isinstance(values, dict):
            return [bytes(values[node]) for node in self.nodes]
        columns = (
            values.position,
            values.velocity,
            values.load,
            values.voltage,
            values.temperature,
            values.current,
        )
        return [_raw(*row) for row in zip(*columns, strict=True)]

    def close(self) -> None:
        self.bus.port.close()
        self.bus.connected = False


def _raw(
    position: float, velocity: float, load: float, voltage: float, temperature: float, current: float
) -> Fields:
    """One motor's quantities in the servo's own units."""
    return Fields(
        round(position / STEP) + MIDDLE,
        round(velocity / STEP),
        round(load * 1000),
        round(voltage * 10),
        round(temperature),
        round(current / 0.0065),
    )


if __name__ == "__main__":
    main(Servolab)
