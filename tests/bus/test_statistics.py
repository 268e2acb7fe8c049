"""The latency histogram and the ledgers."""

from __future__ import annotations

import pytest

from motorbus.bus.statistics import BUCKETS, NodeStatistics, Statistics


@pytest.mark.parametrize(
    ("seconds", "bucket"), [(0.0, 0), (1e-6, 1), (3e-6, 2), (0.001, 10), (1e9, BUCKETS - 1)]
)
def test_a_latency_falls_into_its_power_of_two(seconds: float, bucket: int) -> None:
    ledger = NodeStatistics()
    ledger.answered(seconds)
    assert ledger.latency[bucket] == 1
    assert ledger.ok == 1


def test_a_node_has_one_ledger() -> None:
    statistics = Statistics()
    statistics.of(3).sent += 1
    statistics.of(3).sent += 1
    assert statistics.nodes[3].sent == 2
