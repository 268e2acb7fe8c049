"""What went over the wire, for whoever wants to watch, at no cost to the bus.

A subscriber has a bounded queue: when it does not keep up, the oldest records are dropped and counted, so a slow
reader can never hold up a motor. One that fails, as it writes to a disk that is full, gets no more records.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, NamedTuple, TypeVar

from motorbus.core.operation import Data

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
        """Hand every record to this one too; a subclass may deal with each at once instead of keeping it."""
        self.subscriptions = (*self.subscriptions, subscription)

    def unsubscribe(self, subscription: Subscription[R]) -> None:
        """No more records for this one."""
        self.subscriptions = tuple(s for s in self.subscriptions if s is not subscription)

    def put(self, record: R) -> None:
        """Hand one record to every subscription; one that fails has failed for itself, and not for the bus."""
        for subscription in self.subscriptions:
            try:
                subscription.put(record)
            except Exception as error:
                subscription.failure = error
                self.unsubscribe(subscription)
