"""Rows 3 to 5: system calls and processor time on a pseudo-terminal, whose other end answers at once in one burst.

Processor time is that of the whole process by the kernel's own account; wall time is no measure here, it is the time in
which the kernel wakes two processes. A row that misses its goal is measured once more, and the second time counts.
"""

from __future__ import annotations

from collections.abc import Sequence

from bench import samples
from bench.rounds import CANDIDATES, OURS, Sample
from bench.row import PROCESS, ROUNDS, Row, Say, met
from bench.workloads import WORKLOADS

NUMBERS = ("3", "4", "5")
VENDOR, RUST = "feetech-servo-sdk", "rustypot"
GOALS = (
    ("4", "sync-read-6x2", RUST, "<= 0.80", "<= 0.65"),
    ("4", "sync-read-30x2", RUST, "<= 0.50", "<= 0.40"),
    ("4", "cycle", RUST, "<= 0.80", "<= 0.65"),
    ("5", "read1", RUST, "<= 1.3", "<= 1.0"),
    ("5", "read1", VENDOR, "<= 0.65", "<= 0.5"),
)


def rows(rounds: int, say: Say) -> list[Row]:
    """Rows 3 to 5. Raises Failed, NoCompiler."""
    times = max(rounds, ROUNDS)
    found = samples.on_wire(samples.ESSENTIAL, times, say)
    known = {(one.contender, one.workload) for one in found}
    return [*calls(say), *(_twice(found, times, say, *goal) for goal in GOALS if (goal[2], goal[1]) in known)]


def _twice(
    found: Sequence[Sample],
    times: int,
    say: Say,
    number: str,
    workload: str,
    peer: str,
    goal: str,
    stretch: str,
) -> Row:
    first = against(number, found, workload, peer, goal, stretch)
    if met(first):
        return first
    pair = samples.pair([CANDIDATES[OURS], CANDIDATES[peer]], [WORKLOADS[workload]], times, say)
    second = against(number, pair, workload, peer, goal, stretch)
    return second._replace(note=f"measured twice, first {first.value:.2f}")


def against(number: str, found: Sequence[Sample], workload: str, peer: str, goal: str, stretch: str) -> Row:
    """Ours by theirs in this workload."""
    kind = "pseudo-terminal, processor time"
    return samples.compared(number, kind, found, workload, peer, goal, stretch, PROCESS)


def calls(say: Say) -> list[Row]:
    """Row 3: system calls of ours per exchange, the most of all workloads; none where strace cannot be had."""
    found = {}
    for load in WORKLOADS.values():
        if CANDIDATES[OURS].can(load):
            counted = samples.calls(OURS, load.name, say)
            if counted is None:
                say("strace is absent or may not trace: system calls are not measured\n")
                return []
            found[load.name] = sum(counted.values()) / exchanges(load.name)
    shown = ", ".join(f"{name} {count:.2f}" for name, count in found.items())
    most = max(found.values())
    return [
        Row(
            "3",
            "system calls per exchange, the most of all sizes",
            "-",
            "calls",
            most,
            min(found.values()),
            max(found.values()),
            "<= 4",
            "<= 3",
            samples=1,
            note=f"{shown} (a cycle is two exchanges)",
            margin=0.0,
        )
    ]


def exchanges(workload: str) -> int:
    """How many exchanges one turn of a workload is."""
    load = WORKLOADS[workload]
    return 1 + bool(load.reads and load.writes)
