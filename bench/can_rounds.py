"""CAN side by side with python-canopen and canopen-asyncio, over slcan: simulated servos in a process of their own.

Everyone reads positions, of one node and of eight, in shuffled rounds. Each servo is elsewhere each time it is read,
and every value is checked. The simulator answers at once, so what differs is the library; on a real bus the wire and
the adapter set the pace, and what counts is how many are kept in flight.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from bench.can_loop import FIRST
from bench.places import PEERS, ROOT, surroundings
from bench.rounds import Candidate, Failed, Sample

TIMEOUT = 120.0
NODES = 8
OURS = "motorbus"


class CanWorkload(NamedTuple):
    """Positions of so many nodes; several at once where the library can."""

    name: str
    meaning: str
    nodes: int


WORKLOADS = (
    CanWorkload("can-read1", "position of one node", 1),
    CanWorkload("can-read8", "positions of eight nodes, all at once", NODES),
)
CANDIDATES = (
    Candidate(OURS, "motorbus_can"),
    Candidate("python-canopen", "canopen_client", ("canopen",)),
    Candidate("canopen-asyncio", "canopen_asyncio_client", ("canopen-asyncio",)),
)


def missing() -> list[str]:
    """Contenders that are not there."""
    return [one.name for one in CANDIDATES if any(not (PEERS / name).is_dir() for name in one.peers)]


@contextmanager
def servos() -> Iterator[str]:
    """Simulated servos on a new pseudo-terminal that speaks slcan, for as long as this lasts; the port."""
    command = [sys.executable, "-m", "bench.can_servos", str(FIRST), str(NODES)]
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env=dict(surroundings()),
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        port = process.stdout.readline().strip()
        if not port:
            raise Failed("the simulated servos did not start")
        yield port
    finally:
        process.stdin.close()
        process.wait()
        process.stdout.close()


def run(candidate: Candidate, workload: CanWorkload, count: int) -> dict[str, Any]:
    """One measurement against fresh servos. Raises Failed."""
    with servos() as port:
        done = subprocess.run(
            [
                *(sys.executable, "-m", f"bench.contenders.{candidate.module}"),
                *(port, str(workload.nodes), str(count)),
            ],
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            cwd=ROOT,
            env=dict(surroundings(*candidate.peers)),
        )
    if done.returncode:
        raise Failed(f"{candidate.name}, {workload.name}: {done.stderr.strip() or done.returncode}")
    said: dict[str, Any] = json.loads(done.stdout)
    return said


def rounds(count: int, times: int, progress: Callable[[str], None], seed: int = 2) -> list[Sample]:
    """All samples of this many shuffled rounds. Raises Failed."""
    shuffler = random.Random(seed)
    samples = []
    pairs = [(candidate, workload) for candidate in CANDIDATES for workload in WORKLOADS]
    for number in range(times):
        shuffler.shuffle(pairs)
        for candidate, workload in pairs:
            progress(f"CAN, round {number + 1} of {times}: {candidate.name}, {workload.name}")
            said = run(candidate, workload, count)
            samples.append(Sample(number, candidate.name, workload.name, said["processor"], said["wall"]))
    return samples
