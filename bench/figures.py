"""Medians, spreads and ratios: how many samples become one figure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from statistics import median
from typing import NamedTuple

from bench.rounds import Sample


class Spread(NamedTuple):
    """Median, least and greatest of several samples."""

    median: float
    low: float
    high: float


def spread(samples: Iterable[float]) -> Spread:
    """Raises StatisticsError when there are none."""
    known = list(samples)
    return Spread(median(known), min(known), max(known))


def cost(samples: Iterable[Sample], contender: str, workload: str, of: Callable[[Sample], float]) -> Spread:
    """One contender, one workload, over all rounds."""
    return spread(of(s) for s in samples if s.contender == contender and s.workload == workload)


def ratio(
    samples: Iterable[Sample], ours: str, theirs: str, workload: str, of: Callable[[Sample], float]
) -> Spread:
    """How much we need of what they need, taken within each round."""
    by_round: dict[int, dict[str, float]] = {}
    for sample in samples:
        if sample.workload == workload:
            by_round.setdefault(sample.round, {})[sample.contender] = of(sample)
    return spread(pair[ours] / pair[theirs] for pair in by_round.values() if ours in pair and theirs in pair)
