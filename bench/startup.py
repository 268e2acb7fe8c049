"""What it costs to start: `import motorbus`, `motorbus --help`, and the vendor's SDK for comparison.

Wall time of a whole process less that of an empty one, the best of a few of each; compiled modules are warm.
"""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

from bench.figures import Spread, spread
from bench.places import PEERS, ROOT, surroundings

TAKES = 4
HEAVY = (
    "asyncio", "can", "cyclopts", "matplotlib", "msgspec", "numpy", "rich", "serial", "serialx", "starlette", "uvicorn",
)  # fmt: skip
"""What neither an import nor a help page has any need of, except for the two that print the help page."""


class Start(NamedTuple):
    """A way to start: its name, the arguments of Python, and the folders of `.peers` it needs."""

    name: str
    arguments: tuple[str, ...]
    peers: tuple[str, ...] = ()


EMPTY = Start("empty process", ("-c", "pass"))
STARTS = (
    Start("import motorbus", ("-c", "import motorbus")),
    Start("motorbus --version", ("-m", "motorbus", "--version")),
    Start("motorbus --help", ("-m", "motorbus", "--help")),
    Start("import scservo_sdk", ("-c", "import scservo_sdk"), ("feetech-servo-sdk", "pyserial")),
    Start("import rustypot", ("-c", "import rustypot"), ("rustypot",)),
)


class Cost(NamedTuple):
    """Seconds over an empty process, modules loaded beyond an empty process, and the heavy ones among them."""

    name: str
    seconds: Spread
    modules: int
    heavy: tuple[str, ...]


def _launch(start: Start, *options: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, *options, *start.arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=dict(surroundings(*start.peers)),
    )
    if done.returncode:
        raise OSError(f"{start.name}: {done.stderr.strip()}")
    return done


def _seconds(start: Start) -> float:
    """How much longer than an empty process it takes: the best of a few of each, taken in turn."""
    return _difference([(_lasted(EMPTY), _lasted(start)) for _ in range(TAKES)])


def _difference(pairs: list[tuple[float, float]]) -> float:
    return min(full for _, full in pairs) - min(empty for empty, _ in pairs)


def _lasted(start: Start) -> float:
    began = perf_counter()
    _launch(start)
    return perf_counter() - began


def _modules(start: Start) -> set[str]:
    """Every module the process imports, as `-X importtime` lists them."""
    lines = _launch(start, "-X", "importtime").stderr.splitlines()
    return {line.rsplit("|", 1)[1].strip() for line in lines if line.startswith("import time:")} - {
        "imported package"
    }


def costs(times: int, progress: Callable[[str], None]) -> list[Cost]:
    """All ways to start whose peers are there, in this many shuffled rounds."""
    starts = [start for start in STARTS if all((PEERS / name).is_dir() for name in start.peers)]
    base = _modules(EMPTY)
    loaded = {start: _modules(start) - base for start in starts}
    samples: dict[Start, list[float]] = {start: [] for start in starts}
    shuffler = random.Random(2)
    for number in range(times):
        progress(f"start-up: round {number + 1} of {times}")
        for start in shuffler.sample(starts, len(starts)):
            samples[start].append(_seconds(start))
    return [
        Cost(
            start.name,
            spread(samples[start]),
            len(loaded[start]),
            tuple(sorted({name.partition(".")[0] for name in loaded[start]} & set(HEAVY))),
        )
        for start in starts
    ]
