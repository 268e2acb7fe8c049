"""Runs every contender in a long-lived process with a device of its own, in short stretches and shuffled rounds.

A machine that gets busier meanwhile slows all of them alike: ratios are taken within a round.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from bench.workloads import GROUP_READ, GROUP_WRITE, LATE, READ

ROOT = Path(__file__).resolve().parent.parent
PEERS = ROOT / ".peers"
WORKLOADS = {"feetech": (READ, GROUP_READ, GROUP_WRITE), "kst": (READ, GROUP_READ)}
STRETCH = 300
"""Calls between two changes of contender."""


class Candidate(NamedTuple):
    """A library: its name in the table, its module in `contenders`, its folders of `.peers`, its family."""

    name: str
    module: str
    peers: tuple[str, ...] = ()
    family: str = "feetech"


CANDIDATES = (
    Candidate("motorbus", "motorbus"),
    Candidate("feetech-servo-sdk", "feetech_servo_sdk", ("feetech-servo-sdk", "pyserial")),
    Candidate("ftservo-python-sdk", "ftservo_sdk", ("ftservo-python-sdk", "pyserial")),
    Candidate("rustypot", "rustypot", ("rustypot",)),
    Candidate("lerobot", "lerobot", ("lerobot", "feetech-servo-sdk", "pyserial")),
    Candidate("bare loop", "bare"),
    Candidate("motorbus", "motorbus_can", family="kst"),
    Candidate("python-canopen", "canopen", ("canopen",), family="kst"),
)


class Sample(NamedTuple):
    """One stretch: processor seconds of a call, wrong values, calls that failed."""

    seconds: float
    wrong: int
    errors: int


Samples = dict[tuple[Candidate, str], list[Sample]]


def missing() -> list[str]:
    """Folders of `.peers` that are not there."""
    wanted = {folder for one in CANDIDATES for folder in one.peers}
    return sorted(folder for folder in wanted if not (PEERS / folder).is_dir())


class Running:
    """The process of one contender."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.receive()

    def receive(self) -> Any:
        """The next line that it prints. Raises RuntimeError when it has ended."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self._process.args!r} ended with {self._process.wait()}")
        return json.loads(line)

    def run(self, workload: str, calls: int) -> Sample:
        """One stretch."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([workload, calls]) + "\n")
        self._process.stdin.flush()
        return Sample(**self.receive())


@contextmanager
def _started(module: str, *arguments: str, peers: tuple[str, ...] = ()) -> Iterator[subprocess.Popen[str]]:
    folders = [ROOT, ROOT / "src", *(PEERS / name for name in peers)]
    surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
    command = [sys.executable, "-m", module, *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, env=surroundings, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def _start(candidate: Candidate, folder: Path, stack: ExitStack) -> Running:
    books = str(folder / candidate.module)
    device = stack.enter_context(_started("bench.device", candidate.family, books))
    assert device.stdout is not None
    port = device.stdout.readline().strip()
    module = f"bench.contenders.{candidate.module}"
    return Running(stack.enter_context(_started(module, port, books, peers=candidate.peers)))


def measure(rounds: int, late: int, say: Callable[[str], None]) -> Samples:
    """All stretches of all contenders, all on one core; then `late` reads with 1 % of the replies late."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    samples: Samples = defaultdict(list)
    shuffler = random.Random(1)
    with TemporaryDirectory() as folder, ExitStack() as stack:
        running = {one: _start(one, Path(folder), stack) for one in CANDIDATES}
        pairs = [(one, workload) for one in CANDIDATES for workload in WORKLOADS[one.family]]
        for number in range(rounds):
            say(f"round {number + 1} of {rounds}")
            for candidate, workload in shuffler.sample(pairs, len(pairs)):
                samples[candidate, workload].append(running[candidate].run(workload, STRETCH))
        for candidate in CANDIDATES:
            say(f"late replies: {candidate.name}, {candidate.family}")
            samples[candidate, LATE].append(running[candidate].run(LATE, late))
    return samples
