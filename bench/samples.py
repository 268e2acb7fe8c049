"""What is measured once in a run and told twice: the rows of goals and the tables of details use the same samples."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from operator import attrgetter
from pathlib import Path

from bench import responder, rounds, syscalls
from bench.figures import cost, ratio
from bench.rounds import CANDIDATES, OURS, Candidate, Sample
from bench.row import SINGLE, Row, Say
from bench.workloads import WORKLOADS, Workload

MEMORY_COUNT, WIRE_COUNT = 9000, 2000
"""Exchanges of one sample."""
LARGE = 1800
"""Exchanges of one sample of thirty servos in process, where some need longer for them than for all the rest."""
ESSENTIAL = ("read1", "sync-read-6x2", "sync-read-30x2", "cycle")
"""Workloads that have a goal on the pseudo-terminal and in process."""
BLOCKS = ("sync-read-6x15", "sync-read-6x15-raw")
WRITES = ("sync-write-6x6", "sync-write-30x6")


GROUPS = (ESSENTIAL, BLOCKS, WRITES)
"""Together all workloads, each group measured once."""


def there() -> list[Candidate]:
    """Whoever is installed."""
    return [one for one in CANDIDATES.values() if not one.missing()]


def missing() -> list[str]:
    """Whoever is not, by name."""
    return [one.name for one in CANDIDATES.values() if one.missing()]


def in_python() -> list[Candidate]:
    """Whoever can be measured without a kernel."""
    return [one for one in there() if one.in_memory]


@cache
def in_process(names: tuple[str, ...], times: int, say: Say) -> Sequence[Sample]:
    """These workloads with answers from memory, by every library in Python. Raises Failed."""
    found: list[Sample] = []
    for large in (False, True):
        loads = [WORKLOADS[name] for name in names if (len(WORKLOADS[name].nodes) > 6) is large]
        count = LARGE if large else MEMORY_COUNT
        found += rounds.rounds(rounds.in_memory, in_python(), count, times, say, workloads=loads)
    return found


@cache
def on_wire(names: tuple[str, ...], times: int, say: Say) -> Sequence[Sample]:
    """These workloads on a pseudo-terminal, by everyone. Raises Failed, NoCompiler."""
    return pair(there(), [WORKLOADS[name] for name in names], times, say)


def pair(
    candidates: Sequence[Candidate], workloads: Sequence[Workload], times: int, say: Say
) -> list[Sample]:
    """The same for some of them, and anew each time. Raises Failed, NoCompiler."""
    run = rounds.on_wire(responder.build())
    return rounds.rounds(run, list(candidates), WIRE_COUNT, times, say, workloads=workloads)


@cache
def calls(name: str, workload: str, say: Say) -> dict[str, float] | None:
    """System calls of one contender per exchange, by call; None where they cannot be counted. Raises Failed."""
    if not syscalls.available():
        return None
    program: Path = responder.build()
    say(f"system calls: {name}, {workload}")
    return syscalls.per_exchange(program, CANDIDATES[name], workload)


def all_calls(say: Say) -> dict[tuple[str, str], dict[str, float]] | None:
    """Those of everyone in everything it can do."""
    found = {}
    for one in there():
        for load in WORKLOADS.values():
            if one.can(load):
                counted = calls(one.name, load.name, say)
                if counted is None:
                    return None
                found[one.name, load.name] = counted
    return found


def best(samples: Sequence[Sample], workload: str) -> str:
    """Whoever but ourselves needs least processor time for it. Raises ValueError when there is nobody."""
    costs: dict[str, list[float]] = {}
    for one in samples:
        if one.workload == workload and one.contender != OURS:
            costs.setdefault(one.contender, []).append(one.processor)
    return min(costs, key=lambda name: sorted(costs[name])[len(costs[name]) // 2])


def compared(
    number: str,
    kind: str,
    found: Sequence[Sample],
    workload: str,
    peer: str,
    goal: str,
    stretch: str,
    margin: float = SINGLE,
) -> Row:
    """The row of our processor time by theirs in this workload, of samples of this kind."""
    processor = attrgetter("processor")
    return Row(
        number,
        f"{kind}: {workload}",
        peer,
        "x",
        *ratio(found, OURS, peer, workload, processor),
        goal,
        stretch,
        ours=cost(found, OURS, workload, processor).median,
        theirs=cost(found, peer, workload, processor).median,
        samples=len(of_ours(found, workload)),
        margin=margin,
    )


def of_ours(found: Sequence[Sample], workload: str) -> list[Sample]:
    """Our samples of this workload."""
    return [one for one in found if (one.contender, one.workload) == (OURS, workload)]
