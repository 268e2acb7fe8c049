"""Counters per node: requests, replies, retries, errors, latencies.

`sent = ok + errors + what is in flight` balances per node; a retry counts as sent again. Counters are never reset.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from motorbus.core.operation import ANY, Any_, Due

BUCKETS = 32
"""Of latencies: the last one begins at 18 minutes, longer than any time-out."""


@dataclass(slots=True)
class NodeStatistics:
    """Counters of one node. `latency[k]` counts replies that took at least 2**(k-1) and less than 2**k µs."""

    sent: int = 0
    ok: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    latency: list[int] = field(default_factory=lambda: [0] * BUCKETS)


class Statistics:
    """The counters of all nodes; `other` counts what belongs to none: noise, foreign frames, notices, echoes.

    `settle` is called before `nodes` is read; it adds the replies of prepared requests.
    """

    def __init__(self, settle: Callable[[], None] | None = None) -> None:
        self.other: Counter[str] = Counter()
        self._nodes: dict[int, NodeStatistics] = {}
        self._settle = settle

    @property
    def nodes(self) -> dict[int, NodeStatistics]:
        """The counters by node."""
        if self._settle is not None:
            self._settle()
        return self._nodes

    def add(self, nodes: Sequence[int], times: Sequence[int]) -> None:
        """Add answered requests of these nodes; `times` counts them by latency bucket."""
        count, hit = sum(times), [(bucket, number) for bucket, number in enumerate(times) if number]
        for node in nodes:
            counters = self.of(node)
            counters.sent += count
            counters.ok += count
            for bucket, number in hit:
                counters.latency[bucket] += number

    def asked(self, dues: tuple[Due, ...] | Any_) -> None:
        """Count a request that expects these replies; one without reply, or for any reply, belongs to no node."""
        if dues is ANY or not dues:
            self.other["sent"] += 1
            return
        for due in dues:
            self.of(due.node).sent += 1

    def retried(self, dues: tuple[Due, ...] | Any_) -> None:
        """Count a request that is sent again."""
        for due in () if dues is ANY else dues:
            self.of(due.node).retries += 1

    def answered(self, dues: Iterable[Due], seconds: float) -> None:
        """Count a valid reply of each of these, after so many seconds."""
        bucket = bucket_of(seconds)
        nodes = self._nodes
        for due in dues:
            counters = nodes[due.node]
            counters.ok += 1
            counters.latency[bucket] += 1

    def of(self, node: int) -> NodeStatistics:
        """The counters of this node."""
        counters = self._nodes.get(node)
        if counters is None:
            counters = self._nodes[node] = NodeStatistics()
        return counters


def bucket_of(seconds: float) -> int:
    """The bucket of a reply that took so long."""
    return min(int(seconds * 1e6).bit_length(), BUCKETS - 1)
