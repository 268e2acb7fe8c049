"""System calls per exchange, counted by strace.

A process is run twice with different numbers of exchanges; what the longer run makes more belongs to the
exchanges, and start-up cancels out.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from shutil import which

from bench.rounds import OURS, Candidate, Failed, Wrong, on_wire

OF_MEASURING = {"getrusage", "brk", "mmap", "munmap", "mremap", "madvise"}
"""Calls of the measuring itself, which looks at the clock, and keeps every reading until all are judged."""
SHORT, LONG = 500, 1500
TRIES = 5


def available() -> bool:
    """Whether strace is here and allowed to trace."""
    program = which("strace")
    if program is None:
        return False
    return not subprocess.run([program, "-c", "-o", "/dev/null", "true"], capture_output=True).returncode


def parse(summary: str) -> dict[str, int]:
    """Call -> how often, from the table that `strace -c` prints."""
    found = {}
    for line in summary.splitlines():
        words = line.split()
        if len(words) in (5, 6) and words[3].isdigit() and words[-1] != "total":
            found[words[-1]] = int(words[3])
    return found


def per_exchange(program: Path, candidate: Candidate, workload: str) -> dict[str, float]:
    """Call -> how often per exchange, the frequent ones first; what the measuring itself calls is left out."""
    short, long = (_counted(program, candidate, workload, count) for count in (SHORT, LONG))
    return difference(short, long)


def difference(short: dict[str, int], long: dict[str, int]) -> dict[str, float]:
    """Call -> how often per exchange, from a run of SHORT exchanges and one of LONG."""
    each = {name: (long[name] - short.get(name, 0)) / (LONG - SHORT) for name in long.keys() - OF_MEASURING}
    return dict(sorted(((n, c) for n, c in each.items() if abs(c) >= 0.01), key=lambda pair: -pair[1]))


def _counted(program: Path, candidate: Candidate, workload: str, count: int) -> dict[str, int]:
    """One traced run. A traced process may be held up for longer than a library waits, so it gets further tries.

    Ours gets none where it was wrong.
    """
    for remaining in reversed(range(TRIES)):
        with tempfile.NamedTemporaryFile("r", suffix=".strace") as file:
            try:
                on_wire(program, ("strace", "-c", "-f", "-o", file.name))(candidate, workload, count)
            except Failed as failure:
                if not remaining or (isinstance(failure, Wrong) and candidate.name == OURS):
                    raise
            else:
                return parse(file.read())
    raise AssertionError("unreachable")
