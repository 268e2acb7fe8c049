"""Rows 1 and 2: what the libraries themselves cost, with answers from memory, ours by the best of the others.

The best is whoever in Python needs least in the same run; each library runs in a process of its own, the rounds are
shuffled, a ratio is taken within its round, and every value is checked. A library that has no call for a workload
is left out of it. servolab is the only one that gives every quantity in SI units by one exchange.
"""

from __future__ import annotations

from collections.abc import Sequence

from bench import samples
from bench.rounds import Sample
from bench.row import SAMPLES, Row, Say

NUMBERS = ("1", "2")
FIRST = {
    "read1": ("<= 0.85", "<= 0.7"),
    "sync-read-6x2": ("<= 0.40", "<= 0.30"),
    "sync-read-30x2": ("<= 0.35", "<= 0.25"),
    "cycle": ("<= 0.50", "<= 0.40"),
}
SECOND = {"sync-read-6x15": ("<= 0.35", "<= 0.25"), "sync-read-6x15-raw": ("<= 0.35", "<= 0.25")}


def rows(rounds: int, say: Say) -> list[Row]:
    """Rows 1 and 2. Raises Failed."""
    times = max(rounds, SAMPLES)
    first = samples.in_process(samples.ESSENTIAL, times, say)
    second = samples.in_process(samples.BLOCKS, times, say)
    return [
        *(against("1", first, load, *goal) for load, goal in FIRST.items()),
        *(
            against("2", second, load, *goal)
            for load, goal in SECOND.items()
            if samples.of_ours(second, load)
        ),
    ]


def against(number: str, found: Sequence[Sample], workload: str, goal: str, stretch: str) -> Row:
    """Ours by the best other in this workload."""
    return samples.compared(
        number, "in process", found, workload, samples.best(found, workload), goal, stretch
    )
