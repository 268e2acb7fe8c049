"""Counters per node: requests, replies, retries, errors, latencies. Counters are never reset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

BUCKETS = 32
"""Of latencies: the last one begins at 18 minutes, longer than any time-out."""


@dataclass(slots=True)
class NodeStatistics:
    """Counters of one node. `latency[k]` counts replies that took at least 2**(k-1) and less than 2**k µs."""

    ok: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    latency: list[int] = field(default_factory=lambda: [0] * BUCKETS)

    @property
    def sent(self) -> int:
        """Requests that have ended; a retry counts as sent again."""
        return self.ok + self.errors.total()


class Statistics:
    """The counters of all nodes; `other` counts what belongs to none: noise, foreign frames, notices, echoes."""

    def __init__(self) -> None:
        self.nodes: dict[int, NodeStatistics] = {}
        self.other: Counter[str] = Counter()

    def of(self, node: int) -> NodeStatistics:
        """The counters of this node."""
        counters = self.nodes.get(node)
        if counters is None:
            counters = self.nodes[node] = NodeStatistics()
        return counters

    def retried(self, nodes: Iterable[int]) -> None:
        """Count a request to these that is sent again."""
        for node in nodes:
            self.of(node).retries += 1

    def answered(self, nodes: Iterable[int], seconds: float) -> None:
        """Count a valid reply of each of these, after so many seconds."""
        bucket = min(int(seconds * 1e6).bit_length(), BUCKETS - 1)
        for node in nodes:
            counters = self.nodes.get(node) or self.of(node)
            counters.ok += 1
            counters.latency[bucket] += 1
