"""How long the first byte of an emergency stop takes on the wall clock, over real pseudo-terminals on a loaded machine.

    python -m bench.estop [STOPS]

Four buses of one program, each on a pseudo-terminal of its own: six servos, a stepper controller, a line on which
somebody talks without a pause, and one from which nobody reads. The first two are simulated in processes of their own.
Whoever listens on the wire is another process, and its clock counts: from the moment at which the program asks for the
stop to the first byte that arrives there. Meanwhile a thread polls, and processes that only compute keep every
processor busy, two for each. The program and whoever listens have real-time priority where that is permitted, as a
program that moves a machine would; without it the figure is that of the scheduler on a machine that others use too.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

from bench.places import ROOT, surroundings
from tests.support.processes import Simulated

STOPS = 1000
MOST = 0.050
LATEST = 30.0
"""s after the last one was asked for, in which whoever listens may still write it down."""
SHARE = 0.999
BUSES = {"arm": "feetech", "stage": "stepper", "noisy": "feetech"}
"""Those on which somebody listens; the blocked one takes nothing that could be timed."""
COLUMNS = ("bus", "stops", "median", "99 %", "99.9 %", "longest")
NAMES = {"arm": "six servos", "stage": "stepper controller", "noisy": "a line full of garbage"}


class Wrong(Exception):
    """A stop did not arrive."""


class Sample(NamedTuple):
    """One stop on one bus: s until its first byte arrived."""

    bus: str
    seconds: float


def samples(stops: int, progress: Callable[[str], None]) -> list[Sample]:
    """So many stops of all buses at once. Raises Wrong, MotorbusError and OSError."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        place = Path(folder)
        stack.enter_context(Simulated("feetech", ids="1-6", link=place / "arm.far"))
        stack.enter_context(Simulated("stepper", link=place / "stage.far"))
        for bus, far in (("arm", place / "arm.far"), ("stage", place / "stage.far"), ("noisy", "-")):
            stack.enter_context(_child("wire", bus, str(far), folder))
        for _ in range(2 * (os.cpu_count() or 1)):
            stack.enter_context(_child("load"))
        with _child("program", str(stops), folder) as program:
            assert program.stdout is not None
            asked: list[float] = []
            for number, line in enumerate(program.stdout, 1):
                asked.append(float(line))
                if number % 100 == 0:
                    progress(f"emergency stop {number} of {stops}")
        for bus in BUSES:
            _await(place / f"{bus}.heard", max(asked, default=0.0))
        return [one for bus in BUSES for one in _matched(bus, asked, place / f"{bus}.heard")]


def _await(heard: Path, last: float) -> None:
    """Until a stop arrived that was asked for then, or nobody can be so late: whoever listens has no processor yet."""
    until = time.monotonic() + LATEST
    while _arrived(heard)[-1] < last and time.monotonic() < until:
        time.sleep(0.01)


def _arrived(heard: Path) -> list[float]:
    return [0.0, *map(float, heard.read_text(encoding="ascii").split())]


def _matched(bus: str, asked: Sequence[float], heard: Path) -> Iterator[Sample]:
    """The first stop frame that arrived after each time it was asked for; one that is lost counts until the next.

    Raises Wrong where none came any more.
    """
    arrived = _arrived(heard)
    for number, begun in enumerate(asked):
        first = next((at for at in arrived if at >= begun), None)
        if first is None:
            raise Wrong(f"{bus}: stop {number + 1} of {len(asked)} did not arrive")
        yield Sample(bus, first - begun)


@contextmanager
def _child(*words: str) -> Iterator[subprocess.Popen[str]]:
    """A part of this in a process of its own, ended with the `with`; one that prints says when it is ready."""
    process = subprocess.Popen(
        [sys.executable, "-m", "bench.estop_parts", *words],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env=dict(surroundings()),
    )
    try:
        assert process.stdout is not None
        if process.stdout.readline().strip() != "ready":
            raise Wrong(f"{' '.join(words)} did not begin")
        yield process
    finally:
        process.kill()
        process.communicate()


def at_share(found: Sequence[float], share: float) -> float:
    """What this share of them does not exceed."""
    ordered = sorted(found)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def verdict(found: Sequence[Sample]) -> str:
    """Whether the figure was reached, in words."""
    worst = at_share([one.seconds for one in found], SHARE)
    reached = "reached" if worst <= MOST else "MISSED"
    return f"{SHARE:.1%} of all within {worst * 1e3:.1f} ms. At most {MOST * 1e3:.0f} ms: {reached}."


def rows(found: Sequence[Sample]) -> list[tuple[str, ...]]:
    """One for each bus."""
    return [_row(bus, [one.seconds for one in found if one.bus == bus]) for bus in BUSES]


def _row(bus: str, seconds: Sequence[float]) -> tuple[str, ...]:
    figures = (median(seconds), at_share(seconds, 0.99), at_share(seconds, SHARE), max(seconds))
    return (NAMES[bus], str(len(seconds)), *(f"{one * 1e3:.2f} ms" for one in figures))


def main(words: Sequence[str]) -> int:
    """Measure and print. Exit code 0 when the figure was reached."""
    found = samples(int(words[0]) if words else STOPS, lambda text: print(text, file=sys.stderr))
    for row in (COLUMNS, *rows(found)):
        print("  ".join(f"{cell:<22}" if place == 0 else f"{cell:>9}" for place, cell in enumerate(row)))
    print(verdict(found))
    return 0 if "reached" in verdict(found) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
