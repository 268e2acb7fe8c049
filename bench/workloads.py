"""What is measured, and the rules by which every value is known beforehand.

Shared by the process that conducts and by the contenders' processes, so it needs the standard library only.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

COUNTS = 4096
"""Positions of one turn."""
THERE_AND_BACK = 2 * (COUNTS - 1)
"""Readings after which a servo shows the same again: it counts up to the end of its range and down again."""

IDS = (1, 2, 3, 4, 5, 6)
THIRTY = tuple(range(1, 31))
MOST_IDS = 240
"""Ids that one SYNC READ names here. Its length, which is one byte, allows 251, but the vendor's SDK makes no packet
of more than 250 bytes."""

WARM_UP = 200
"""Exchanges before the clock runs."""

POSITION, FIELDS, BLOCK = "position", "fields", "block"
"""What is read of each servo: 2 bytes at 56; the quantities in the 15 bytes at 56 in SI units; those bytes as they
come."""
SIZES = {POSITION: 2, FIELDS: 15, BLOCK: 15}


class Workload(NamedTuple):
    """One kind of exchange.

    `method`  what a contender calls it
    `reads`   servos that each exchange reads
    `writes`  servos whose goal each exchange writes
    `stride`  exchanges between two barriers; writes that nobody answers must not outrun the responder, so every
              so often one reading, outside the measured time, waits for it. 0 is no barrier
    `what`    is read: POSITION, FIELDS or BLOCK
    """

    name: str
    method: str
    meaning: str
    reads: tuple[int, ...] = ()
    writes: tuple[int, ...] = ()
    stride: int = 0
    what: str = POSITION

    @property
    def nodes(self) -> tuple[int, ...]:
        """All servos that take part, from 1 on."""
        return tuple(range(1, max(*self.reads, *self.writes, 1) + 1))


WORKLOADS = {
    workload.name: workload
    for workload in (
        Workload("read1", "read", "READ of 2 bytes at 56 from one servo", reads=IDS[:1]),
        Workload("sync-read-6x2", "sync_read", "SYNC READ of 2 bytes at 56 from six servos", reads=IDS),
        Workload(
            "sync-read-30x2", "sync_read", "SYNC READ of 2 bytes at 56 from thirty servos", reads=THIRTY
        ),
        Workload(
            "sync-read-6x15",
            "fields",
            "SYNC READ of 15 bytes at 56 from six servos, every quantity in SI units",
            reads=IDS,
            what=FIELDS,
        ),
        Workload(
            "sync-read-6x15-raw",
            "blocks",
            "SYNC READ of 15 bytes at 56 from six servos, the bytes as they come",
            reads=IDS,
            what=BLOCK,
        ),
        Workload(
            "sync-write-6x6",
            "sync_write",
            "SYNC WRITE of 6 bytes at 42 to six servos, no reply",
            writes=IDS,
            stride=32,
        ),
        Workload(
            "sync-write-30x6",
            "sync_write",
            "SYNC WRITE of 6 bytes at 42 to thirty servos, no reply",
            writes=THIRTY,
            stride=8,
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

GROWTH = (1, 2, 4, 8, 16, 32, 64, 128, 192, 240, 253)
"""Numbers of servos at which the growth of cost is looked at; above MOST_IDS it takes two packets."""


def growing(servos: int) -> Workload:
    """The workload `many-N`: positions of so many servos, by as few SYNC READs as can name them."""
    reads = tuple(range(1, servos + 1))
    return Workload(f"many-{servos}", "many", f"SYNC READ of 2 bytes at 56 from {servos} servos", reads=reads)


def named(name: str) -> Workload:
    """A workload by its name. Raises KeyError."""
    known = {one.name: one for one in map(growing, GROWTH)} | WORKLOADS
    return known[name]


def parts(nodes: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Servos by as many as one SYNC READ can name."""
    return [nodes[start : start + MOST_IDS] for start in range(0, len(nodes), MOST_IDS)]


def position(node: int, readings: int) -> int:
    """What servo `node` shows after so many readings, in counts."""
    return to_and_fro(100 * node + readings)


def to_and_fro(number: int) -> int:
    """The count that comes after so many from 0 on, up and down and up again."""
    at = number % THERE_AND_BACK
    return at if at < COUNTS else THERE_AND_BACK - at


class Fields(NamedTuple):
    """What a servo measures, in its own units: counts, counts/s, thousandths, 0.1 V, degrees C, 6.5 mA."""

    position: int
    velocity: int
    load: int
    voltage: int
    temperature: int
    current: int


def fields(node: int, readings: int) -> Fields:
    """All that servo `node` shows after so many readings; only the position changes."""
    return Fields(position(node, readings), 50 + node, 100 + node, 120, 30 + node % 8, 10 + node)


def block(node: int, readings: int) -> bytes:
    """The same as the 15 bytes at 56 hold it; it moves, and nothing is wrong with it."""
    here, velocity, load, voltage, temperature, current = fields(node, readings)
    return struct.pack("<HHHBBBBBHH", here, velocity, load, voltage, temperature, 0, 0, 1, 0, current)


EXPECTED: dict[str, Callable[[int, int], Any]] = {POSITION: position, FIELDS: fields, BLOCK: block}
"""By what is read: the rule for one servo and one reading."""


def goals(exchange: int, nodes: tuple[int, ...] = IDS) -> list[int]:
    """The goals of one exchange, in counts: within a turn, never the same twice running."""
    return [(1024 + 7 * exchange + 311 * node) % 2048 + 1024 for node in nodes]
