"""rustypot, a Rust core with Python bindings, by its typed STS3215 controller."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

from bench.measure import Contender, main
from bench.workloads import NODES

STEP = math.tau / 4096


class Rustypot(Contender):
    """Radians from the middle of the turn."""

    def __init__(self, port: str) -> None:
        module: Any = import_module("rustypot")
        self.nodes = list(NODES)
        self.controller = module.Sts3215PyController(port, 1_000_000, 0.1)

    def read(self) -> Any:
        return self.controller.read_present_position(1)

    def read_group(self) -> Any:
        return self.controller.sync_read_present_position(self.nodes)

    def write_group(self, goals: list[float]) -> None:
        self.controller.sync_write_goal_position(self.nodes, goals)

    def prepare(self, goals: list[int]) -> list[float]:
        return [(goal + 0.5) * STEP - math.pi for goal in goals]  # it truncates to counts

    def to_counts(self, values: Any) -> list[int]:
        return [round((value + math.pi) / STEP) for value in values]


if __name__ == "__main__":
    main(Rustypot)
