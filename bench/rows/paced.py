"""Rows 6 and 7: a cycle on a line of 1 Mbaud on which bytes take their time, flat out: rate, and processor time.

A cycle is a SYNC WRITE of six goals and a SYNC READ of six positions: 88 bytes of ten bits, 880 us. With a turnaround
the line is silent for that long between the request and the answers, which then come without a gap. The wire limit is
what that leaves. Nobody has real-time priority here: whoever waits in a busy loop would keep out what moves the bytes.
A row that misses its goal is measured once more, and the second time counts.

How six answers reach a program is a matter of its adapter, so it is measured both ways, for everyone alike. *In one
burst*: all 48 bytes at once when the last has passed, as one hands them over that holds bytes back for longer. *In
pieces*: each packet of 8 bytes as its last byte has passed, as from a FIFO or an adapter that holds nothing back; then
there are six times to wake up in each cycle, and a library may sleep through most of them or not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import NamedTuple

from bench import responder
from bench.figures import Spread, cost, ratio, spread
from bench.rounds import CANDIDATES, OURS, Sample, on_wire
from bench.rounds import rounds as shuffled
from bench.row import PROCESS, ROUNDS, Row, Say, met, noted
from bench.workloads import WORKLOADS

NUMBERS = ("6", "7")
processor, wall = attrgetter("processor"), attrgetter("wall")
BAUD = 1_000_000
BYTES = 88
"""Of one cycle: 26 of the goals, 14 of the request, six answers of 8."""
COUNT = 1000
"""Cycles of one sample."""


class Line(NamedTuple):
    """What a line does between a request and its answers (s), how these are handed over, and what share is the goal."""

    turnaround: float
    goal: str
    stretch: str
    pieces: bool = False

    @property
    def named(self) -> str:
        """As the measure names it."""
        how = "in pieces" if self.pieces else "in one burst"
        return f"1 Mbaud, turnaround {self.turnaround * 1e6:.0f} µs, answers {how}"


LINES = (
    Line(0.0, ">= 91", ">= 94"),
    Line(50e-6, ">= 93", ">= 96"),
    Line(0.0, ">= 91", ">= 94", pieces=True),
)
VENDOR, RUST = "feetech-servo-sdk", "rustypot"
FLOOR = "bare loop"
WHO = (OURS, RUST, VENDOR, FLOOR)


def limit(turnaround: float) -> float:
    """Cycles per second that the wire carries."""
    return 1 / (BYTES * 10 / BAUD + turnaround)


def rows(rounds: int, say: Say) -> list[Row]:
    """Rows 6 and 7. Raises Failed, NoCompiler."""
    times = max(rounds, ROUNDS)
    found: list[Row] = []
    for line in LINES:
        first = judged(measured(times, line, say), line)
        if not all(map(met, first)):
            first = anew(first, judged(measured(times, line, say), line))
        found += first
    return sorted(found, key=lambda row: row.number)


def anew(first: Sequence[Row], second: Sequence[Row]) -> list[Row]:
    """The second time for whatever missed the first time, unless the peer could not be measured the second time."""
    again = {(row.number, row.measure, row.peer): row for row in second}
    return [_second(one, again.get((one.number, one.measure, one.peer))) for one in first]


def _second(one: Row, two: Row | None) -> Row:
    if met(one) or two is None:
        return one
    return two._replace(note=noted(two.note, f"measured twice, first {one.value:.2f}"))


def measured(times: int, line: Line, say: Say) -> list[Sample]:
    """Cycles of ours, of the Rust peer, of the vendor's SDK and of system calls alone. Raises Failed, NoCompiler."""
    run = on_wire(responder.build(), baud=BAUD, turnaround=line.turnaround, pieces=line.pieces)
    there = [CANDIDATES[name] for name in WHO if not CANDIDATES[name].missing()]
    return shuffled(run, there, COUNT, times, say, workloads=[WORKLOADS["cycle"]])


def judged(found: Sequence[Sample], line: Line) -> list[Row]:
    """The rows of one line; those against somebody who is not installed are left out."""
    result = [_of_the_wire(found, line)]
    known = {one.contender for one in found}
    if RUST in known:
        rate = ratio(found, RUST, OURS, "cycle", wall)
        result.append(_row("6", f"{line.named}: cycle rate", RUST, rate, ">= 0.98", "", found, wall))
    for peer, most, less in ((RUST, "<= 0.8", "<= 0.6"), (VENDOR, "<= 0.15", "<= 0.08")):
        if peer in known:
            needed = ratio(found, OURS, peer, "cycle", processor)
            measure = f"{line.named}: processor time per cycle"
            result.append(_row("7", measure, peer, needed, most, less, found, processor))
    return result


def _of_the_wire(found: Sequence[Sample], line: Line) -> Row:
    """How much of the wire limit we achieve, without a margin, and beside it what system calls alone achieve."""
    shares = {
        who: spread(100 / one.wall / limit(line.turnaround) for one in found if one.contender == who)
        for who in {one.contender for one in found}
    }
    told = f"{FLOOR}: {shares[FLOOR].median:.1f} %" if FLOOR in shares else ""
    count = len([one for one in found if one.contender == OURS])
    measure, goals = f"{line.named}: of the wire limit", (line.goal, line.stretch)
    return Row("6", measure, "-", "%", *shares[OURS], *goals, samples=count, note=told, margin=0.0)


def _row(
    number: str,
    measure: str,
    peer: str,
    value: Spread,
    goal: str,
    stretch: str,
    found: Sequence[Sample],
    of: Callable[[Sample], float],
) -> Row:
    """A ratio; a margin has only what is processor time."""
    return Row(
        number,
        measure,
        peer,
        "x",
        *value,
        goal,
        stretch,
        ours=cost(found, OURS, "cycle", of).median,
        theirs=cost(found, peer, "cycle", of).median,
        samples=len([one for one in found if one.contender == OURS]),
        margin=PROCESS if of is processor else 0.0,
    )
