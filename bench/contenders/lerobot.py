"""LeRobot's FEETECH bus by register names, without its normalisation.

The package needs torch and others for its other parts. Small modules stand in for the four functions that its motor
modules import from those; the measured code is its own.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from bench.measure import Contender, main
from bench.workloads import NODES

STAND_INS: dict[str, dict[str, Any]] = {
    "lerobot.utils.utils": {"enter_pressed": None, "move_cursor_up": None},
    "deepdiff": {"DeepDiff": lambda one, other: [] if one == other else [one, other]},
    "tqdm": {"tqdm": None},
}


class LeRobot(Contender):
    """Counts by motor names."""

    def __init__(self, port: str) -> None:
        for name, members in STAND_INS.items():
            sys.modules[name] = ModuleType(name)
            vars(sys.modules[name]).update(members)
        feetech: Any = import_module("lerobot.motors.feetech")
        motors: Any = import_module("lerobot.motors")
        self.names = [f"m{node}" for node in NODES]
        mode = motors.MotorNormMode.RANGE_M100_100
        table = {f"m{node}": motors.Motor(node, "sts3215", mode) for node in NODES}
        self.bus = feetech.FeetechMotorsBus(port, table)
        self.bus.connect(handshake=False)

    def read(self) -> int:
        return int(self.bus.read("Present_Position", "m1", normalize=False))

    def read_group(self) -> Any:
        return self.bus.sync_read("Present_Position", self.names, normalize=False)

    def write_group(self, goals: list[int]) -> None:
        self.bus.sync_write("Goal_Position", dict(zip(self.names, goals, strict=True)), normalize=False)

    def to_counts(self, values: Any) -> list[int]:
        return [values] if isinstance(values, int) else [values[name] for name in self.names]


if __name__ == "__main__":
    main(LeRobot)
