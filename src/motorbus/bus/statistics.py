"""How well each node is doing: counted by turns, read by anyone, reset by nobody.

`sent = ok + errors + what is in flight` balances per node; a retry counts as sent again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from motorbus.core.operation import ANY, Any_, Due

BUCKETS = 24


@dataclass(slots=True)
class NodeStatistics:
    """One node's ledger. `latency[k]` counts replies that took at least 2**(k-1) and less than 2**k µs."""

    sent: int = 0
    ok: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    latency: list[int] = field(default_factory=lambda: [0] * BUCKETS)


@dataclass(slots=True)
class Statistics:
    """The ledgers of all nodes, and what belongs to none: noise, foreign frames, notices, echoes."""

    nodes: dict[int, NodeStatistics] = field(default_factory=dict)
    other: Counter[str] = field(default_factory=Counter)

    def asked(self, dues: tuple[Due, ...] | Any_) -> None:
        """A request has left that calls for these replies; one that calls for none, or for any, belongs to no node."""
        if dues is ANY or not dues:
            self.other["sent"] += 1
            return
        for due in dues:
            self.of(due.node).sent += 1

    def answered(self, dues: Iterable[Due], seconds: float) -> None:
        """A good reply of each of these, all of them after this time."""
        bucket = min(int(seconds * 1e6).bit_length(), BUCKETS - 1)
        nodes = self.nodes
        for due in dues:
            ledger = nodes[due.node]
            ledger.ok += 1
            ledger.latency[bucket] += 1

    def of(self, node: int) -> NodeStatistics:
        """This node's ledger, a new one at its first exchange."""
        ledger = self.nodes.get(node)
        if ledger is None:
            ledger = self.nodes[node] = NodeStatistics()
        return ledger
