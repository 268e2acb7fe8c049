"""Every contender does every workload once a round, in an order that differs from round to round.

So a machine that gets slower or busier meanwhile hurts all of them alike, and a ratio is taken within its round.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from bench.places import PEERS, ROOT, surroundings
from bench.responder import responder
from bench.workloads import WORKLOADS

TIMEOUT = 120.0


class Candidate(NamedTuple):
    """Who is measured: its name, its file in `contenders`, and the folders of `.peers` it needs."""

    name: str
    module: str
    peers: tuple[str, ...] = ()

    def missing(self) -> list[str]:
        """Folders that are not there."""
        return [name for name in self.peers if not (PEERS / name).is_dir()]


CANDIDATES = {
    candidate.name: candidate
    for candidate in (
        Candidate("motorbus", "motorbus"),
        Candidate("rustypot", "rustypot", ("rustypot",)),
        Candidate("feetech-servo-sdk", "feetech_servo_sdk", ("feetech-servo-sdk", "pyserial")),
        Candidate("bare loop", "bare"),
    )
}


class Sample(NamedTuple):
    """One contender, one workload, one round: seconds per exchange."""

    round: int
    contender: str
    workload: str
    processor: float
    wall: float


class Failed(Exception):
    """A contender did not finish, returned a wrong value, or its books differ from the responder's."""


def command(candidate: Candidate, port: str, workload: str, count: int) -> list[str]:
    """How the process of a contender is started."""
    return [sys.executable, "-m", f"bench.contenders.{candidate.module}", port, workload, str(count)]


def run(
    program: Path, candidate: Candidate, workload: str, count: int, prefix: Iterable[str] = ()
) -> dict[str, Any]:
    """One measurement in a process of its own, its books compared with the responder's. Raises Failed."""
    with responder(program) as wire:
        done = subprocess.run(
            [*prefix, *command(candidate, wire.port, workload, count)],
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            cwd=ROOT,
            env=dict(surroundings(*candidate.peers)),
        )
    if done.returncode:
        raise Failed(f"{candidate.name}, {workload}: {done.stderr.strip() or done.returncode}")
    said: dict[str, Any] = json.loads(done.stdout)
    compare(candidate, said["books"], wire.books)
    return said


def compare(candidate: Candidate, said: dict[str, list[int]], books: dict[str, Any]) -> None:
    """Raises Failed unless the wire saw exactly the readings and goals that the contender says it made."""
    for node, figures in said.items():
        if books["servos"][node] != figures:
            raise Failed(
                f"{candidate.name}: servo {node} counted readings, writings, sum of goals "
                f"{books['servos'][node]}, but the contender says {figures}"
            )
    if books["strays"]:
        raise Failed(f"{candidate.name}: {books['strays']} bytes or packets on the wire that are no request")


def rounds(
    program: Path,
    candidates: list[Candidate],
    count: int,
    times: int,
    progress: Callable[[str], None],
    seed: int = 1,
) -> list[Sample]:
    """All samples of this many shuffled rounds. Raises Failed."""
    shuffler = random.Random(seed)
    samples = []
    pairs = [(candidate, workload) for candidate in candidates for workload in WORKLOADS]
    for number in range(times):
        shuffler.shuffle(pairs)
        for candidate, workload in pairs:
            progress(f"round {number + 1} of {times}: {candidate.name}, {workload}")
            said = run(program, candidate, workload, count)
            samples.append(Sample(number, candidate.name, workload, said["processor"], said["wall"]))
    return samples
