"""The latency histogram."""

from __future__ import annotations

import pytest

from motorbus.bus.statistics import BUCKETS, Statistics


@pytest.mark.parametrize(
    ("seconds", "bucket"), [(0.0, 0), (1e-6, 1), (3e-6, 2), (0.001, 10), (1e9, BUCKETS - 1)]
)
def test_a_latency_falls_into_its_power_of_two(seconds: float, bucket: int) -> None:
    statistics = Statistics()
    statistics.answered((3, 4), seconds)
    for counters in statistics.nodes.values():
        assert (counters.sent, counters.ok) == (1, 1)
        assert counters.latency[bucket] == sum(counters.latency) == 1
