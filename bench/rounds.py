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

from bench import memory
from bench.loop import WRONG
from bench.places import PEERS, ROOT, surroundings
from bench.responder import responder
from bench.workloads import WORKLOADS, Workload

TIMEOUT = 120.0
REPEATS = 5


class Candidate(NamedTuple):
    """Who is measured: its name, its file in `contenders`, and the folders of `.peers` it needs.

    `in_memory`  it can also be measured without a kernel, for it is in Python
    `cannot`     methods of workloads for which it has no call
    """

    name: str
    module: str
    peers: tuple[str, ...] = ()
    in_memory: bool = False
    cannot: tuple[str, ...] = ()

    def missing(self) -> list[str]:
        """Folders that are not there."""
        return [name for name in self.peers if not (PEERS / name).is_dir()]

    def can(self, workload: Workload) -> bool:
        """Whether it has a call for this."""
        return workload.method not in self.cannot


_SDK = ("feetech-servo-sdk", "pyserial")
CANDIDATES = {
    candidate.name: candidate
    for candidate in (
        Candidate("motorbus", "motorbus", in_memory=True),
        Candidate("rustypot", "rustypot", ("rustypot",), cannot=("fields",)),
        Candidate("feetech-servo-sdk", "feetech_servo_sdk", _SDK, True, ("fields",)),
        Candidate("ftservo-python-sdk", "ftservo_sdk", ("ftservo-python-sdk", "pyserial"), True, ("fields",)),
        Candidate("st3215", "st3215", ("st3215", "pyserial"), True, ("fields",)),
        Candidate("servolab", "servolab", ("servolab", "pyserial"), True, ("sync_read", "many", "cycle")),
        Candidate("feetech-cli", "feetech_cli", ("feetech-cli", "pyserial"), True, ("fields",)),
        Candidate("lerobot", "lerobot", ("lerobot", *_SDK), True, ("fields", "blocks", "many", "sync_write")),
        Candidate("bare loop", "bare", cannot=("fields", "many")),
    )
}
OURS = "motorbus"


class Sample(NamedTuple):
    """One contender, one workload, one round: seconds per exchange, and how many attempts were spoiled before."""

    round: int
    contender: str
    workload: str
    processor: float
    wall: float
    repeats: int = 0


class Failed(Exception):
    """A contender did not finish: an answer came later than it waits, or got lost."""


class Wrong(Failed):
    """A contender returned a wrong value, or its books differ from the responder's; ours is not tried again then."""


Run = Callable[[Candidate, str, int], dict[str, Any]]
"""Carries out one measurement: who, which workload, how many exchanges."""


def on_wire(
    program: Path, prefix: Iterable[str] = (), baud: int = 0, turnaround: float = 0.0, pieces: bool = False
) -> Run:
    """Against a fresh responder on a pseudo-terminal, the books compared. `prefix` is a program to run it under.

    With a `baud` rate bytes take their time, and an answer begins after a `turnaround` (s); with `pieces` each packet
    of it is handed over as its last byte has passed.
    """

    def run(candidate: Candidate, workload: str, count: int) -> dict[str, Any]:
        with responder(program, baud, turnaround, pieces=pieces) as wire:
            said = _launch(candidate, wire.port, workload, count, prefix)
        compare(candidate, said["books"], wire.books, said["late"])
        return said

    return run


def in_memory(candidate: Candidate, workload: str, count: int) -> dict[str, Any]:
    """Against answers inside the process."""
    return _launch(candidate, memory.PORT, workload, count)


def _launch(
    candidate: Candidate, port: str, workload: str, count: int, prefix: Iterable[str] = ()
) -> dict[str, Any]:
    module = f"bench.contenders.{candidate.module}"
    done = subprocess.run(
        [*prefix, sys.executable, "-m", module, port, workload, str(count)],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        cwd=ROOT,
        env=dict(surroundings(*candidate.peers)),
    )
    if done.returncode:
        told = done.stderr.strip()
        kind = Wrong if told.startswith(WRONG) else Failed
        raise kind(f"{candidate.name}, {workload}: {told or done.returncode}")
    said: dict[str, Any] = json.loads(done.stdout)
    return said


def compare(candidate: Candidate, said: dict[str, list[int]], books: dict[str, Any], late: int = 0) -> None:
    """Raises Wrong unless the wire saw exactly the readings and goals that the contender says it made.

    Failed, where all it saw besides are readings that may have been asked for once more, for an answer was `late`.
    """
    for node, figures in said.items():
        seen = books["servos"][node]
        if seen != figures:
            more = seen[1:] == figures[1:] and 0 < seen[0] - figures[0] <= late
            raise (Failed if more else Wrong)(
                f"{candidate.name}: servo {node} counted readings, writings, sum of goals "
                f"{seen}, but the contender says {figures}"
            )
    if books["strays"]:
        raise Wrong(f"{candidate.name}: {books['strays']} bytes or packets on the wire that are no request")


def rounds(
    run: Run,
    candidates: list[Candidate],
    count: int,
    times: int,
    progress: Callable[[str], None],
    seed: int = 1,
    workloads: Iterable[Workload] = tuple(WORKLOADS.values()),
) -> list[Sample]:
    """All samples of this many shuffled rounds, each candidate at what it can do.

    Of another's library that stays spoiled this one sample is missing, which is said. Raises Failed when it is ours,
    and at once when ours was wrong.
    """
    shuffler = random.Random(seed)
    samples = []
    pairs = [(one, load.name) for one in candidates for load in workloads if one.can(load)]
    for number in range(times):
        shuffler.shuffle(pairs)
        for candidate, workload in pairs:
            progress(f"round {number + 1} of {times}: {candidate.name}, {workload}")
            try:
                said, repeats = _patiently(run, candidate, workload, count, progress)
            except Failed as failure:
                if candidate.name == OURS:
                    raise
                progress(f"left out of round {number + 1}: {str(failure).splitlines()[-1]}\n")
                continue
            samples.append(Sample(number, candidate.name, workload, said["processor"], said["wall"], repeats))
    return samples


def _patiently(
    run: Run, candidate: Candidate, workload: str, count: int, progress: Callable[[str], None]
) -> tuple[dict[str, Any], int]:
    """A busy machine can hold up a process for longer than a library waits; again and again is no accident.

    How another takes that, a wrong value included, is not ours to judge. Ours has to raise, never to be wrong.
    """
    for repeats in range(REPEATS):
        try:
            return run(candidate, workload, count), repeats
        except Failed as failure:
            if isinstance(failure, Wrong) and candidate.name == OURS:
                raise
            progress(f"once more, because: {str(failure).splitlines()[-1]}\n")
    return run(candidate, workload, count), REPEATS
