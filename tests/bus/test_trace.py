"""A slow watcher loses the oldest records and is told how many; the bus never waits for it."""

from __future__ import annotations

from motorbus.bus.trace import Feed


def test_every_subscription_gets_every_record() -> None:
    feed: Feed[int] = Feed()
    one, two = feed.subscribe(), feed.subscribe()
    feed.put(1)
    feed.put(2)
    assert list(one) == list(two) == [1, 2]
    assert len(one) == 0


def test_what_does_not_fit_is_dropped_from_the_front_and_counted() -> None:
    feed: Feed[int] = Feed()
    small = feed.subscribe(limit=3)
    for number in range(10):
        feed.put(number)
    assert small.dropped == 7
    assert list(small) == [7, 8, 9]


def test_an_unsubscribed_watcher_gets_nothing_more() -> None:
    feed: Feed[int] = Feed()
    watcher = feed.subscribe()
    feed.unsubscribe(watcher)
    feed.put(1)
    assert list(watcher) == []
