"""motorbus on CAN by its public calls; a group is read with several requests in flight."""

from __future__ import annotations

import math
from typing import Any

import motorbus
from bench.measure import Contender, main
from bench.workloads import BITRATE, NODES
from motorbus import kst
from motorbus.core.steps import gather

COUNTS = 10 * math.degrees(1)
"""Raw counts of a radian."""


class Motorbus(Contender):
    """One blocking bus, servos made once."""

    family = "kst"

    def __init__(self, port: str) -> None:
        self.bus = motorbus.open(f"kst:can://slcan{port},bitrate={BITRATE}")
        self.servos = [kst.Servo(self.bus, node) for node in NODES]

    def read(self) -> float:
        return self.servos[0].position()

    def read_group(self) -> Any:
        return self.bus.run(_read_all(self.servos))

    def to_counts(self, values: Any) -> list[int]:
        return [round(value * COUNTS) for value in ([values] if isinstance(values, float) else values)]


async def _read_all(servos: list[kst.Servo]) -> Any:
    return await gather(*[kst.Servo.position.function(servo) for servo in servos])


if __name__ == "__main__":
    main(Motorbus)
