"""One table of all measurements, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from statistics import median, quantiles
from typing import Any

from bench.runner import CANDIDATES, STRETCH, Candidate, Samples
from bench.workloads import GROUP_READ, GROUP_WRITE, LATE, READ

OURS = "motorbus"
TITLES = ("workload", "family", "library", "calls", "µs", "ratio", "ratio p10", "wrong", "errors")
NOTE = (
    "µs: processor time of a call, median. ratio: motorbus / library, median of the ratios within a round;\n"
    "p10: ratio of the 10th percentiles. wrong: values the servo did not have during the call, or goals lost."
)


def rows(samples: Samples, late: int) -> Iterator[dict[str, Any]]:
    """One record for each workload and library."""
    for workload in (READ, GROUP_READ, GROUP_WRITE, LATE):
        for candidate in CANDIDATES:
            found = samples.get((candidate, workload))
            if found:
                calls = late if workload == LATE else STRETCH * len(found)
                yield {
                    "workload": workload,
                    "family": candidate.family,
                    "library": candidate.name,
                    "calls": calls,
                    **({} if workload == LATE else _times(samples, candidate, workload)),
                    "wrong": sum(one.wrong for one in found),
                    "errors": sum(one.errors for one in found),
                }


def _times(samples: Samples, candidate: Candidate, workload: str) -> dict[str, float]:
    theirs = [one.seconds for one in samples[candidate, workload]]
    times = {"µs": round(median(theirs) * 1e6, 1)}
    if candidate.name == OURS:
        return times
    us = next(one for one in CANDIDATES if one.name == OURS and one.family == candidate.family)
    ours = [one.seconds for one in samples[us, workload]]
    ratio = median(one / other for one, other in zip(ours, theirs, strict=True))
    return {**times, "ratio": round(ratio, 2), "ratio p10": round(_low(ours) / _low(theirs), 2)}


def _low(values: list[float]) -> float:
    return quantiles(values, n=10)[0] if len(values) > 1 else values[0]


def as_text(records: list[dict[str, Any]]) -> str:
    """The table for a terminal."""
    cells = [TITLES, *(tuple(str(record.get(title, "")) for title in TITLES) for record in records)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in cells]
    return "\n".join([*lines, "", NOTE])
