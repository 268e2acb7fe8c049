"""What is measured, and the rules by which every value is known beforehand.

Shared by the process that conducts and by the contenders' processes, so it needs the standard library only.
"""

from __future__ import annotations

from typing import NamedTuple

COUNTS = 4096
THERE_AND_BACK = 2 * (COUNTS - 1)
"""Readings after which a servo shows the same again: it counts up to the end of its range and down again."""
"""Positions of one turn; the responder counts its readings modulo this."""

IDS = (1, 2, 3, 4, 5, 6)

WARM_UP = 200
"""Exchanges before the clock runs."""


class Workload(NamedTuple):
    """One kind of exchange.

    `method`  what a contender calls it
    `reads`   servos whose position each exchange reads
    `writes`  servos whose goal each exchange writes
    `stride`  exchanges between two barriers; writes that nobody answers must not outrun the responder, so every
              so often one reading, outside the measured time, waits for it. 0 is no barrier
    """

    name: str
    method: str
    meaning: str
    reads: tuple[int, ...] = ()
    writes: tuple[int, ...] = ()
    stride: int = 0


WORKLOADS = {
    workload.name: workload
    for workload in (
        Workload("read1", "read", "READ of 2 bytes at 56 from one servo", reads=IDS[:1]),
        Workload("sync-read-6x2", "sync_read", "SYNC READ of 2 bytes at 56 from six servos", reads=IDS),
        Workload(
            "sync-write-6x6",
            "sync_write",
            "SYNC WRITE of 6 bytes at 42 to six servos, no reply",
            writes=IDS,
            stride=32,
        ),
        Workload(
            "cycle",
            "cycle",
            "SYNC WRITE of six goals, then SYNC READ of six positions",
            reads=IDS,
            writes=IDS,
        ),
    )
}


def position(node: int, readings: int) -> int:
    """What servo `node` shows after so many readings, in counts."""
    return to_and_fro(100 * node + readings)


def to_and_fro(number: int) -> int:
    """The count that comes after so many from 0 on, up and down and up again."""
    at = number % THERE_AND_BACK
    return at if at < COUNTS else THERE_AND_BACK - at


def goals(exchange: int) -> list[int]:
    """The goals of one exchange, in counts: within a turn, never the same twice running."""
    return [(1024 + 7 * exchange + 311 * node) % 2048 + 1024 for node in IDS]
