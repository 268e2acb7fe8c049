"""What a bus shows of itself: records of what went over the wire, for subscribers, and counters.

A subscription is a bounded queue: when it is full, the oldest record is dropped and counted, so a slow reader never
holds up the bus. A subscription whose `put` raises gets no more records.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

from motorbus.core.request import Data

R = TypeVar("R")


class TraceRecord(NamedTuple):
    """One request ("tx") or one delivery of the link ("rx"), and when, on the link's clock (s)."""

    at: float
    direction: str
    data: Data


class Subscription(Generic[R]):
    """A bounded queue of records; iterating takes out what is there.

    `dropped` counts what did not fit. `failure` is why it gets no more, where a subclass has failed.
    """

    def __init__(self, limit: int) -> None:
        self._records: deque[R] = deque(maxlen=limit)
        self.dropped = 0
        self.failure: Exception | None = None

    def put(self, record: R) -> None:
        if len(self._records) == self._records.maxlen:
            self.dropped += 1
        self._records.append(record)

    def __iter__(self) -> Iterator[R]:
        while self._records:
            yield self._records.popleft()

    def __len__(self) -> int:
        return len(self._records)


class Feed(Generic[R]):
    """Hands records to any number of subscriptions; without one, recording costs a truth test."""

    def __init__(self) -> None:
        self.subscriptions: tuple[Subscription[R], ...] = ()

    def subscribe(self, limit: int = 1024) -> Subscription[R]:
        """A new queue of at most `limit` records."""
        subscription: Subscription[R] = Subscription(limit)
        self.add(subscription)
        return subscription

    def add(self, subscription: Subscription[R]) -> None:
        """Send every record to this subscription; a subclass may process each at once."""
        self.subscriptions = (*self.subscriptions, subscription)

    def unsubscribe(self, subscription: Subscription[R]) -> None:
        """Send this subscription no more records."""
        self.subscriptions = tuple(s for s in self.subscriptions if s is not subscription)

    def put(self, record: R) -> None:
        """Hand one record to every subscription, and remove one that raises."""
        for subscription in self.subscriptions:
            try:
                subscription.put(record)
            except Exception as error:
                subscription.failure = error
                self.unsubscribe(subscription)


@dataclass(slots=True)
class NodeStatistics:
    """Counters of one node: accepted replies, requests sent again, failed replies by kind."""

    ok: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)

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
