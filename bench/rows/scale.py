"""Scale of simulators: what a full bus takes of a core in real time, and a fleet of ten thousand axes in memory.

There is no peer. Two rows: `motorbus simulate --pace` with 253 FEETECH servos on a pseudo-terminal at 1 Mbaud, and with
127 KST nodes behind slcan at 1 Mbit/s, while a client leaves no gap on the line (`bench.full_line`); the figure is the
simulator's processor time by the time that something was on the wire, so a client that the machine held up does not
make it better. A third: forty buses of 251 axes in one process on virtual clocks, each axis
given goals and read at a stated rate (`bench.fleet`); the figure is the time that passed for them by processor time.
There is no driver in the third: what a fleet costs that is driven by ordinary buses, `examples/fleet.py` tells. Real
time is real time, so no row has a margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Final

from bench import fleet, full_line
from bench.figures import spread
from bench.fleet import Fleet
from bench.full_line import Filled, share
from bench.row import ROUNDS, Row, Say

NUMBERS = ("scale",)
SECONDS: Final = 3.0
"""s for which a line is kept full, each time."""
IN_TIME: Final = 1e-3
"""s by which an answer may come late before a program can tell: a USB adapter hands over what has come once a ms."""


def rows(rounds: int, say: Say) -> list[Row]:
    """All three. Raises Failed, and MotorbusError when a simulator does not start."""
    times = max(rounds, ROUNDS)
    found: list[Row] = []
    for name, filled in full_line.LINES:
        samples = []
        for number in range(times):
            say(f"a full line, {name}: {number + 1} of {times}")
            samples.append(filled(SECONDS))
        found.append(line_row(name, samples))
    fleets = []
    for number in range(times):
        say(f"a fleet in memory: {number + 1} of {times}")
        fleets.append(fleet.in_a_process())
    return [*found, fleet_row(fleets)]


def line_row(name: str, samples: Sequence[Filled]) -> Row:
    """What a full line takes of a core, in percent."""
    middle, least, greatest = spread(100 * one.core / one.wire for one in samples)
    late = sorted(moment for one in samples for moment in one.late)
    in_time = sum(moment <= IN_TIME for moment in late) / len(late)
    note = (
        f"wire {median(one.wire for one in samples):.1%} full; of {len(late)} answers half come within "
        f"{share(late, 0.5) * 1e6:.0f} µs of their moment, 99 % within {share(late, 0.99) * 1e6:.0f} µs, "
        f"{in_time:.2%} within 1 ms; the latest {late[-1] * 1e3:.1f} ms"
    )
    return Row(
        "scale",
        f"simulator of {name}, line full, in real time: of one core",
        "-",
        "%",
        middle,
        least,
        greatest,
        "< 100",
        samples=len(samples),
        note=note,
        margin=0.0,
    )


def fleet_row(samples: Sequence[Fleet]) -> Row:
    """How much faster than real time a fleet is."""
    one = samples[0]
    each = median(sample.processor / sample.simulated / sample.axes for sample in samples)
    note = (
        f"each axis is given {one.goals:g} goals and read {one.reads:g} times a second and never rests: "
        f"{each * 1e6:.0f} µs of processor time for its second; built in "
        f"{median(sample.built for sample in samples):.1f} s, "
        f"{median(sample.memory for sample in samples) / 1000:.1f} kB of memory for an axis"
    )
    return Row(
        "scale",
        f"{one.axes} FEETECH axes in memory, without a driver: times real time on one core",
        "-",
        "x",
        *spread(sample.speed for sample in samples),
        "> 1",
        samples=len(samples),
        note=note,
        margin=0.0,
    )
