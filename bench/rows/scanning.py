"""Row 13: how long a scan of all 254 ids takes at 1 Mbaud on a line without an adapter, and whether it misses anybody.

The responder in C on a pseudo-terminal, on which bytes take their time; twelve servos from id 20 to 240, so 242 ids are
silent, as most are in most scans, and each servo answers after half a millisecond. `latency=0` says that no adapter
holds bytes back. Wall time in a process of its own:
what it is made of is waiting, so that another process computes beside it changes little.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Final

from bench import apart
from bench.responder import build, responder
from bench.row import PROCESS, ROUNDS, Row, Say

NUMBERS = ("13",)
MODULE: Final = "bench.rows.scanning"
BAUD: Final = 1_000_000
THINKING: Final = 0.0005
"""s from the end of a request to the answer: about as long as a return delay can be."""
EVERY: Final = 20
THERE: Final = tuple(range(EVERY, 254, EVERY))
JOB: Final = apart.Job("scan", MODULE)


def rows(rounds: int, say: Say) -> list[Row]:
    """Both rows 13: the time, and how many were missed in all scans. Raises Failed or NoCompiler."""
    program = build()
    said = apart.rounds([JOB], max(rounds, ROUNDS), say, lambda job: _run(program))["scan"]
    seconds = [one["seconds"] for one in said]
    wrong = [error for error in (misjudged(one["found"]) for one in said) if error]
    note = (
        f"{len(THERE)} of 254 answer; each silent id is asked twice and waited for as long as a servo may think, "
        "return delay included"
    )
    spread = median(seconds), min(seconds), max(seconds)
    time = Row(
        "13",
        "scan of 254 ids at 1 Mbaud on a direct line",
        "-",
        "s",
        *spread,
        "< 1.0",
        "< 0.5",
        median(seconds),
        samples=len(seconds),
        note=note,
        margin=PROCESS,
    )
    return [time, missed(wrong, len(seconds))]


def missed(wrong: Sequence[str], scans: int) -> Row:
    """How many of the scans were wrong, and in what."""
    measure, figure = "scans that missed a servo, or found one that is not there", float(len(wrong))
    note = "; ".join(sorted(set(wrong)))
    return Row("13", measure, "-", "", figure, figure, figure, "<= 0", samples=scans, note=note, margin=0.0)


def misjudged(found: Sequence[int]) -> str:
    """What is wrong with this result of a scan; "" when it is right."""
    lost, strange = sorted(set(THERE) - set(found)), sorted(set(found) - set(THERE))
    if not lost and not strange:
        return ""
    return f"missed {lost or 'nobody'}, found {strange or 'nobody'} who is not there"


def _run(program: Path) -> dict[str, Any]:
    with responder(program, BAUD, THINKING, EVERY) as wire:
        return apart.told(JOB, wire.port)


def measured(port: str) -> dict[str, Any]:
    """One scan of everything: seconds of wall time, and who was found."""
    import motorbus
    from motorbus import feetech

    with motorbus.open(f"feetech:{port},baud={BAUD},latency=0") as bus:
        began = perf_counter()
        found = bus.run(feetech.scan())
        return {"seconds": perf_counter() - began, "found": [one.node for one in found]}


if __name__ == "__main__":
    json.dump(measured(sys.argv[1]), sys.stdout)
