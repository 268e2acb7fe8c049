"""How cost grows with the number of servos: positions of 1 to 253 by SYNC READ, ours and the cheapest others.

In process with answers from memory, and as processor time on a pseudo-terminal whose other end answers at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from bench import responder, rounds
from bench.figures import Spread, spread
from bench.rounds import CANDIDATES, OURS
from bench.row import Say
from bench.workloads import GROWTH, growing

COUNT = 250
"""Exchanges of one sample."""
TIMES = 3
"""Rounds, for there are many points."""
IN_PROCESS = (OURS, "feetech-servo-sdk", "feetech-cli")
ON_WIRE = (OURS, "rustypot", "feetech-servo-sdk")
MEMORY, WIRE = "in process", "on a pseudo-terminal"


class Point(NamedTuple):
    """Seconds of processor time that one contender needs for the positions of so many servos, in one of two places."""

    place: str
    contender: str
    servos: int
    seconds: Spread


def points(times: int, say: Say, sizes: Sequence[int] = GROWTH, count: int = COUNT) -> list[Point]:
    """All of them; whoever is not installed is left out. Raises Failed, NoCompiler."""
    return [
        *_points(MEMORY, rounds.in_memory, IN_PROCESS, sizes, count, times, say),
        *_points(WIRE, rounds.on_wire(responder.build()), ON_WIRE, sizes, count, times, say),
    ]


def _points(
    place: str,
    run: rounds.Run,
    names: Sequence[str],
    sizes: Sequence[int],
    count: int,
    times: int,
    say: Say,
) -> list[Point]:
    there = [CANDIDATES[name] for name in names if not CANDIDATES[name].missing()]
    found = rounds.rounds(run, there, count, times, say, workloads=[growing(size) for size in sizes])
    return [
        Point(
            place,
            one.name,
            size,
            spread(
                sample.processor
                for sample in found
                if (sample.contender, sample.workload) == (one.name, growing(size).name)
            ),
        )
        for one in there
        for size in sizes
    ]
