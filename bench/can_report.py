"""The CAN part of the page: what each library needs for a position, and how much faster ours is in the same round."""

from __future__ import annotations

from operator import attrgetter

from bench.can_rounds import CANDIDATES, OURS, WORKLOADS
from bench.figures import cost, ratio
from bench.rounds import Sample

MICRO = 1e6
wall, processor = attrgetter("wall"), attrgetter("processor")

TEXT = """## CAN, over slcan

Positions of simulated KST servos in another process, over the slcan protocol on a pseudo-terminal. The servos answer
at once and the bus takes no bit time, so this compares libraries; what a bus at its bit rate carries, and how much of
that motorbus uses, is computed exactly in [figures](reference/figures.md). *Times as many* is our readings per second
divided by theirs, taken within each round: the median, and in brackets the least and the greatest. python-canopen
reads several nodes by a thread each, canopen-asyncio by a task each, motorbus by one blocking bus that keeps them all
in flight.

"""
COLUMNS = ("", "", "readings/s", "min – max", "processor µs", "times as many")


def rows(samples: list[Sample]) -> list[tuple[str, ...]]:
    """One for each workload and library."""
    return [
        _row(samples, workload.name, candidate.name)
        for workload in WORKLOADS
        for candidate in CANDIDATES
        if any(sample.contender == candidate.name for sample in samples)
    ]


def _row(samples: list[Sample], workload: str, name: str) -> tuple[str, ...]:
    time = cost(samples, name, workload, wall)
    used = cost(samples, name, workload, processor)
    compared = ""
    if name != OURS:
        found = ratio(samples, name, OURS, workload, wall)
        compared = f"{found.median:.2f} ({found.low:.2f} – {found.high:.2f})"
    speed = f"{1 / time.median:.0f}", f"{1 / time.high:.0f} – {1 / time.low:.0f}"
    return (workload, name, *speed, f"{used.median * MICRO:.1f}", compared)
