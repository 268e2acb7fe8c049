"""System calls per exchange, counted by strace.

A process is run twice with different numbers of exchanges; what the longer run makes more belongs to the
exchanges, and start-up cancels out.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from shutil import which

from bench.rounds import Candidate, run

SHORT, LONG = 500, 1500


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
    """Call -> how often per exchange, the frequent ones first; those below 0.01 are left out."""
    short, long = (_counted(program, candidate, workload, count) for count in (SHORT, LONG))
    each = {name: (long[name] - short.get(name, 0)) / (LONG - SHORT) for name in long}
    return dict(sorted(((n, c) for n, c in each.items() if abs(c) >= 0.01), key=lambda pair: -pair[1]))


def _counted(program: Path, candidate: Candidate, workload: str, count: int) -> dict[str, int]:
    with tempfile.NamedTemporaryFile("r", suffix=".strace") as file:
        run(program, candidate, workload, count, prefix=("strace", "-c", "-f", "-o", file.name))
        return parse(file.read())
