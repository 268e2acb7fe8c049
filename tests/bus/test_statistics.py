"""The latency histogram and the ledgers."""

from __future__ import annotations

import pytest

from motorbus.bus.statistics import BUCKETS, Statistics
from motorbus.core.request import ANY, Expected


@pytest.mark.parametrize(
    ("seconds", "bucket"), [(0.0, 0), (1e-6, 1), (3e-6, 2), (0.001, 10), (1e9, BUCKETS - 1)]
)
def test_a_latency_falls_into_its_power_of_two(seconds: float, bucket: int) -> None:
    statistics = Statistics()
    dues = Expected(3, 3, 8), Expected(4, 4, 8)
    statistics.asked(dues)
    statistics.answered(dues, seconds)
    for ledger in statistics.nodes.values():
        assert (ledger.sent, ledger.ok) == (1, 1)
        assert ledger.latency[bucket] == sum(ledger.latency) == 1


def test_what_nobody_or_anybody_answers_belongs_to_no_node() -> None:
    statistics = Statistics()
    statistics.asked(())
    statistics.asked(ANY)
    assert statistics.other["sent"] == 2
    assert not statistics.nodes


def test_a_node_has_one_ledger() -> None:
    statistics = Statistics()
    statistics.of(3).sent += 1
    statistics.of(3).sent += 1
    assert statistics.nodes[3].sent == 2
