"""LeRobot's FEETECH bus, lerobot 0.4.4, by register names, without its normalisation.

The package needs torch, and other packages of gigabytes, before this one module of it can be imported. It uses
nothing of them: of what it imports only two functions for the keyboard, a progress bar and a comparison of
tables lie beyond it. So small modules stand in for those; the code that is measured is all its own, with the
vendor's SDK below it as its authors have it.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from bench import memory
from bench.contenders.sdk_port import MemoryPort
from bench.loop import main
from bench.workloads import Workload


def _differences(one: Any, other: Any) -> list[Any]:
    """Between two tables of registers, which it asks for once."""
    return [] if one == other else [one, other]


STAND_INS: dict[str, dict[str, Any]] = {
    "lerobot.utils.utils": {"enter_pressed": None, "move_cursor_up": None},
    "deepdiff": {"DeepDiff": _differences},
    "tqdm": {"tqdm": None},
}


def _module() -> Any:
    """Its package of motors."""
    for name, members in STAND_INS.items():
        module = ModuleType(name)
        vars(module).update(members)
        sys.modules[name] = module
    return import_module("lerobot.motors.feetech")


class LeRobot:
    """Motors by names of their own; counts in and out."""

    def __init__(self, port: str, workload: Workload) -> None:
        feetech, motors = _module(), import_module("lerobot.motors")
        nodes = workload.reads or workload.writes
        self.names = [f"m{node}" for node in nodes]
        table = {
            f"m{node}": motors.Motor(node, "sts3215", motors.MotorNormMode.RANGE_M100_100)
            for node in workload.nodes
        }
        self.bus = feetech.FeetechMotorsBus(port, table)
        self.first = next(iter(table))
        if port == memory.PORT:
            self._use(MemoryPort(workload))
        else:
            self.bus.connect(handshake=False)

    def _use(self, port: MemoryPort) -> None:
        self.bus.port_handler = port
        self.bus.sync_reader.port = port
        self.bus.sync_writer.port = port

    def read(self, prepared: Any) -> int:
        return int(self.bus.read("Present_Position", self.first, normalize=False))

    def sync_read(self, prepared: Any) -> Any:
        return self.bus.sync_read("Present_Position", self.names, normalize=False)

    def cycle(self, prepared: list[int]) -> Any:
        goals = dict(zip(self.names, prepared, strict=True))
        self.bus.sync_write("Goal_Position", goals, normalize=False)
        return self.bus.sync_read("Present_Position", self.names, normalize=False)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: int | dict[str, int]) -> list[int]:
        return [values] if isinstance(values, int) else [values[name] for name in self.names]

    def close(self) -> None:
        self.bus.port_handler.closePort()


if __name__ == "__main__":
    main(LeRobot)
