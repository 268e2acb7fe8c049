"""Counters per node: requests, replies, retries, errors, latencies.

`sent = ok + errors + what is in flight` per node, but for a prepared request during which the port was lost. A retry
counts as sent again. Counters are never reset.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from motorbus.core.request import ANY, Any_, Expected

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
    """The counters of all nodes; `other` counts what belongs to none: noise, foreign frames, notices, echoes."""

    def __init__(self) -> None:
        self.other: Counter[str] = Counter()
        self._nodes: dict[int, NodeStatistics] = {}
        self._groups: dict[tuple[int, ...], list[int]] = {}

    @property
    def nodes(self) -> dict[int, NodeStatistics]:
        """The counters by node, as they are now."""
        found = {
            number: NodeStatistics(one.sent, one.ok, one.retries, one.errors.copy(), one.latency.copy())
            for number, one in tuple(self._nodes.items())
        }
        for group, times in tuple(self._groups.items()):
            count = sum(times)
            for number in group if count else ():
                counters = found.setdefault(number, NodeStatistics())
                counters.sent += count
                counters.ok += count
                counters.latency = [a + b for a, b in zip(counters.latency, times, strict=True)]
        return found

    def group(self, nodes: tuple[int, ...]) -> list[int]:
        """Requests that all of these nodes answered, by latency; prepared requests count here."""
        return self._groups.setdefault(nodes, [0] * BUCKETS)

    def asked(self, dues: tuple[Expected, ...] | Any_) -> None:
        """Count a request that expects these replies; one without reply, or for any reply, belongs to no node."""
        if dues is ANY or not dues:
            self.other["sent"] += 1
            return
        for due in dues:
            self.of(due.node).sent += 1

    def retried(self, dues: tuple[Expected, ...] | Any_) -> None:
        """Count a request that is sent again."""
        for due in () if dues is ANY else dues:
            self.of(due.node).retries += 1

    def answered(self, dues: Iterable[Expected], seconds: float) -> None:
        """Count a valid reply of each of these, after so many seconds."""
        bucket = min(int(seconds * 1e6).bit_length(), BUCKETS - 1)
        for due in dues:
            counters = self.of(due.node)
            counters.ok += 1
            counters.latency[bucket] += 1

    def of(self, node: int) -> NodeStatistics:
        """The counters of this node without those of prepared requests; to count in."""
        counters = self._nodes.get(node)
        if counters is None:
            counters = self._nodes[node] = NodeStatistics()
        return counters
