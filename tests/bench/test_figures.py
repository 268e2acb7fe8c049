"""Ratios are taken within a round, so a machine that is slow in one round cannot tilt them."""

from __future__ import annotations

from operator import attrgetter

import pytest

from bench.figures import Spread, cost, ratio
from bench.rounds import Sample

processor = attrgetter("processor")
SAMPLES = [
    Sample(0, "ours", "read1", 1.0, 9.0),
    Sample(0, "theirs", "read1", 2.0, 9.0),
    Sample(1, "ours", "read1", 10.0, 9.0),  # a slow round, for both
    Sample(1, "theirs", "read1", 40.0, 9.0),
    Sample(2, "ours", "read1", 3.0, 9.0),
    Sample(2, "theirs", "read1", 3.0, 9.0),
    Sample(2, "ours", "cycle", 99.0, 9.0),
    Sample(3, "ours", "read1", 5.0, 9.0),  # the other is missing in this round
]


def test_cost_is_the_median_with_the_extremes() -> None:
    assert cost(SAMPLES[:-1], "ours", "read1", processor) == Spread(3.0, 1.0, 10.0)


def test_ratio_pairs_the_samples_of_a_round() -> None:
    assert ratio(SAMPLES, "ours", "theirs", "read1", processor) == pytest.approx((0.5, 0.25, 1.0))
