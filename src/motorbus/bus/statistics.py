"""How well each node is doing: counted by turns, read by anyone, reset by nobody.

`sent = ok + errors + what is in flight` balances per node; a retry counts as sent again.
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
    """One node's ledger. `latency[k]` counts replies that took at least 2**(k-1) and less than 2**k µs."""

    sent: int = 0
    ok: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    latency: list[int] = field(default_factory=lambda: [0] * BUCKETS)


class Statistics:
    """The ledgers of all nodes, and what belongs to none: noise, foreign frames, notices, echoes.

    `settle` is called before anybody looks at `nodes`: it counts what was put off.
    """

    def __init__(self, settle: Callable[[], None] | None = None) -> None:
        self.other: Counter[str] = Counter()
        self._nodes: dict[int, NodeStatistics] = {}
        self._settle = settle

    @property
    def nodes(self) -> dict[int, NodeStatistics]:
        """The ledgers by node."""
        if self._settle is not None:
            self._settle()
        return self._nodes

    def add(self, nodes: Sequence[int], times: Sequence[int]) -> None:
        """Several exchanges with all of these, each answered; `times` are they by their buckets."""
        count, hit = sum(times), [(bucket, number) for bucket, number in enumerate(times) if number]
        for node in nodes:
            ledger = self.of(node)
            ledger.sent += count
            ledger.ok += count
            for bucket, number in hit:
                ledger.latency[bucket] += number

    def asked(self, dues: tuple[Due, ...] | Any_) -> None:
        """A request has left that calls for these replies; one that calls for none, or for any, belongs to no node."""
        if dues is ANY or not dues:
            self.other["sent"] += 1
            return
        for due in dues:
            self.of(due.node).sent += 1

    def retried(self, dues: tuple[Due, ...] | Any_) -> None:
        """A request that calls for these replies is sent again."""
        for due in () if dues is ANY else dues:
            self.of(due.node).retries += 1

    def answered(self, dues: Iterable[Due], seconds: float) -> None:
        """A good reply of each of these, all of them after this time."""
        bucket = bucket_of(seconds)
        nodes = self._nodes
        for due in dues:
            ledger = nodes[due.node]
            ledger.ok += 1
            ledger.latency[bucket] += 1

    def of(self, node: int) -> NodeStatistics:
        """This node's ledger, a new one at its first exchange."""
        ledger = self._nodes.get(node)
        if ledger is None:
            ledger = self._nodes[node] = NodeStatistics()
        return ledger


def bucket_of(seconds: float) -> int:
    """The bucket of a reply that took so long."""
    return min(int(seconds * 1e6).bit_length(), BUCKETS - 1)
