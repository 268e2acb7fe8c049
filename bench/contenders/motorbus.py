"""Ours, by its public calls: names, radians, the gate in place, everything checked that is always checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import monotonic
from typing import Any

import motorbus
from bench import memory
from bench.loop import main
from bench.workloads import BLOCK, COUNTS, FIELDS, SIZES, Fields, Workload, parts
from motorbus import feetech
from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.motion.safety import Gate

STEP = math.tau / COUNTS
SPEED = 1000 * STEP
PRESENT = 56
LONG = 0.1
"""s of air that a train of answers may need here: nobody has to be stopped in between."""


class MemoryLink:
    """A link without a kernel: what is written is answered at once."""

    def __init__(self, workload: Workload) -> None:
        self.name = "memory"
        self.rate = 1_000_000
        self.latency = 0.0
        self.paced = False
        self.virtual = False
        self.simulated = True
        self.warnings: tuple[str, ...] = ()
        self.answer: Callable[[Any], bytes] = memory.Wire(workload).answer
        self.arrived: list[Data] = []

    now = staticmethod(monotonic)

    def write(self, data: Data) -> None:
        answer = self.answer(data)
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


def _in_memory(workload: Workload) -> Bus:
    """A bus as `motorbus.open` would leave it, after the test of the echo."""
    driver = feetech.FAMILY.open()
    bus = Bus(MemoryLink(workload), driver, interlock=Gate())
    test = driver.echo_test()
    assert test is not None
    bus.expect_echo(test)
    bus.run(test)
    return bus


class Motorbus:
    """Servos are prepared once, prepared exchanges kept, as a control loop would."""

    def __init__(self, port: str, workload: Workload) -> None:
        self.bus = (
            _in_memory(workload) if port == memory.PORT else motorbus.open(f"feetech:{port},baud=1000000")
        )
        every = {node: feetech.Servo(self.bus, node) for node in workload.nodes}
        for servo in every.values():
            servo.prepare()
        self.first = every[1]
        self.nodes = workload.reads or workload.writes
        self.servos = [every[node] for node in self.nodes]
        self.groups = [
            self._kept([every[node] for node in part], workload.what) for part in parts(workload.reads)
        ]
        self.kept: Any = self.groups[0] if self.groups else None
        self.rows = feetech.sync_writer(self.servos, "goal_position", "goal_time", "goal_velocity")
        self.goals = feetech.sync_writer(self.servos, "goal_position")

    def _kept(self, servos: list[feetech.Servo], what: str) -> Any:
        if what == FIELDS:
            return feetech.sync_read_states(servos)
        if what == BLOCK:
            return feetech.sync_read_raw(PRESENT, SIZES[BLOCK], servos)
        return feetech.sync_read_positions(servos, air=LONG)

    def read(self, prepared: Any) -> float:
        return self.first.position()

    def sync_read(self, prepared: Any) -> Any:
        return self.bus.run(self.kept)

    fields = blocks = sync_read

    def many(self, prepared: Any) -> list[Any]:
        return [self.bus.run(group) for group in self.groups]

    def sync_write(self, prepared: list[tuple[float, ...]]) -> None:
        self.bus.run(self.rows(prepared))

    def cycle(self, prepared: list[float]) -> Any:
        return self.bus.exchange((self.goals(prepared), self.kept))[1]

    def prepare(self, counts: list[int]) -> list[Any]:
        if self.kept is None:
            return [(goal * STEP, 0.0, SPEED) for goal in counts]
        return [goal * STEP for goal in counts]

    def counts(self, values: Any) -> list[Any]:
        if isinstance(values, float):
            return [round(values / STEP)]
        found: dict[int, Any] = {}
        for group in values if isinstance(values, list) else [values]:
            found |= group if isinstance(group, dict) else group.values
        return [_raw(found.get(node)) for node in self.nodes]

    def late(self) -> int:
        """Twice the requests whose answer did not come in time, of all servos: each may be asked again, and probed."""
        ledgers = self.bus.statistics.nodes.values()
        return 2 * sum(ledger.sent - ledger.ok for ledger in ledgers)

    def close(self) -> None:
        self.bus.close()


def _raw(value: Any) -> Any:
    """One servo's position, quantities or bytes in the servo's own units; None where it did not answer."""
    if isinstance(value, float):
        return round(value / STEP)
    if value is None or isinstance(value, bytes):
        return value
    return Fields(
        round(value.position / STEP),
        round(value.velocity / STEP),
        round(value.load * 1000),
        round(value.voltage * 10),
        round(value.temperature),
        round(value.current / 0.0065),
    )


if __name__ == "__main__":
    main(Motorbus)
