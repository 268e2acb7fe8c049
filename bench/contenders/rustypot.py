"""rustypot 1.13.1, a Rust core with Python bindings, by its typed STS3215 controller: names and radians.

Its typed calls know single registers only, so the six-byte write goes through its raw call, with the bytes made
here as its user would have to.
"""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

import rustypot  # type: ignore[import-not-found]

from bench.loop import main
from bench.workloads import COUNTS, Workload, parts

GOAL, POSITION, SIZE = 42, 56, 15
SIX_BYTES = struct.Struct("<HHH")


class Goals(NamedTuple):
    """The same goals for the raw call and for the typed one."""

    counts: list[int]
    radians: list[float]


class Rustypot:
    """Angles are radians from the middle of the turn."""

    def __init__(self, port: str, workload: Workload) -> None:
        self.nodes = list(workload.reads or workload.writes)
        self.parts = [list(part) for part in parts(workload.reads)]
        self.controller = rustypot.Sts3215PyController(port, 1_000_000, 0.1)

    def read(self, prepared: Any) -> Any:
        return self.controller.read_present_position(1)

    def sync_read(self, prepared: Any) -> Any:
        return self.controller.sync_read_present_position(self.nodes)

    def many(self, prepared: Any) -> Any:
        return [value for part in self.parts for value in self.controller.sync_read_present_position(part)]

    def blocks(self, prepared: Any) -> Any:
        return self.controller.sync_read_raw_data(self.nodes, POSITION, SIZE)

    def sync_write(self, prepared: Goals) -> None:
        self.controller.sync_write_raw_data(
            self.nodes, GOAL, [list(SIX_BYTES.pack(goal, 0, 1000)) for goal in prepared.counts]
        )

    def cycle(self, prepared: Goals) -> Any:
        self.controller.sync_write_goal_position(self.nodes, prepared.radians)
        return self.controller.sync_read_present_position(self.nodes)

    def prepare(self, counts: list[int]) -> Goals:
        # The middle of the count: it cuts radians down to counts where others round, and the goals are checked.
        return Goals(counts, [(goal + 0.5) * math.tau / COUNTS - math.pi for goal in counts])

    def counts(self, values: Any) -> list[Any]:
        if isinstance(values[0], float):
            return [round((value + math.pi) * COUNTS / math.tau) for value in values]
        return [bytes(value) for value in values]

    def close(self) -> None:
        self.controller.close()


if __name__ == "__main__":
    main(Rustypot)
