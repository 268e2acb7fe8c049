"""Row 11: what awaiting costs over blocking: one position read, by `AsyncServo` and by `Servo`.

Each in a process of its own against the responder in C on a pseudo-terminal. Processor time of our process alone, per
read, taken within each round; every value is checked.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from statistics import median
from typing import Any, Final

from bench import apart
from bench.loop import check
from bench.responder import build, responder
from bench.row import PROCESS, ROUNDS, Row, Say, pairs
from bench.workloads import COUNTS, WARM_UP
from motorbus.bus.statistics import Statistics

NUMBERS = ("11",)
MODULE: Final = "bench.rows.asynchronous"
AWAITED, BLOCKING = "async", "blocking"
READS: Final = 3000
STEP: Final = math.tau / COUNTS
JOBS: Final = tuple(apart.Job(name, MODULE, (name,)) for name in (AWAITED, BLOCKING))


def rows(rounds: int, say: Say) -> list[Row]:
    """Row 11. Raises Failed or NoCompiler."""
    program = build()
    found = apart.rounds(JOBS, max(rounds, ROUNDS), say, lambda job: _run(program, job))
    awaited, blocking = ([one["processor"] for one in found[name]] for name in (AWAITED, BLOCKING))
    note = (
        f"{median(awaited) * 1e6:.1f} µs where the blocking call takes {median(blocking) * 1e6:.1f} µs: "
        "the event loop wakes by its own selector and switches to the task"
    )
    return [
        Row(
            "11",
            "async read1 over our own blocking call, processor time",
            "motorbus, blocking",
            "x",
            *pairs(awaited, blocking),
            "<= 2.5",
            "<= 2",
            median(awaited),
            median(blocking),
            len(awaited),
            note,
            PROCESS,
        )
    ]


def _run(program: Path, job: apart.Job) -> dict[str, Any]:
    with responder(program) as wire:
        return apart.told(job, wire.port, str(READS))


# -- in a process of its own -------------------------------------------------------------------------------------


def measured(name: str, port: str, reads: int) -> dict[str, float]:
    """Seconds of processor time for each read. Raises WrongValue, and Late where a read was asked again."""
    values, seconds, late = {AWAITED: _awaited, BLOCKING: _blocking}[name](
        f"feetech:{port},baud=1000000", reads
    )
    check([[round(value / STEP)] for value in values], (1,), late=late)
    return {"processor": seconds / reads}


Measured = tuple[Sequence[float], float, int]
"""What was read (rad), seconds of processor time, and how many answers were late."""


def _late(statistics: Statistics) -> int:
    """As in `bench.contenders.motorbus`."""
    return 2 * sum(ledger.sent - ledger.ok for ledger in statistics.nodes.values())


def _blocking(address: str, reads: int) -> Measured:
    import motorbus
    from motorbus import feetech

    with motorbus.open(address) as bus:
        servo = feetech.Servo(bus, 1)
        servo.prepare()
        values = [servo.position() for _ in range(WARM_UP)]
        keep, began = values.append, _used()
        for _ in range(reads):
            keep(servo.position())
        return values, _used() - began, _late(bus.statistics)


def _awaited(address: str, reads: int) -> Measured:
    import asyncio

    import motorbus
    from motorbus import feetech

    async def course() -> Measured:
        async with motorbus.open_async(address) as bus:
            servo = feetech.AsyncServo(bus, 1)
            await servo.prepare()
            values = [await servo.position() for _ in range(WARM_UP)]
            keep, began = values.append, _used()
            for _ in range(reads):
                keep(await servo.position())
            return values, _used() - began, _late(bus.statistics)

    return asyncio.run(course())


def _used() -> float:
    used = getrusage(RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    json.dump(measured(sys.argv[1], sys.argv[2], int(sys.argv[3])), sys.stdout)
