"""Which nodes are in sync. Decision record 0039.

A node is in flight from the first byte of a request until its reply is accepted, and out of sync if none is. Before
the next request to it the bus is silent for a quiet time, then sends a probe: a request whose reply differs in key or
length from every reply that the node owes. A link is first in, first out, so when the probe is answered no older
reply can follow.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

from motorbus.core.family import BusDriver
from motorbus.core.request import ANY, Expected, Key, Request

PROBES: Final = 64
"""Probes compared with what a node owes, to find one that differs."""
LONGEST_BACK_OFF: Final = 1.0
"""s between probes of a silent node of a group."""

Kind: TypeAlias = "tuple[int, Key, int]"
"""Lane, key and length of a reply."""


class NodeSync:
    """One node: what it owes, and when it may be asked."""

    __slots__ = (
        "asked_at",
        "lane",
        "length",
        "owed",
        "probe_at",
        "probes",
        "quiet_until",
        "silences",
    )

    def __init__(self) -> None:
        self.owed: dict[Kind, None] = {}  # the oldest first
        self.length = 0  # of its last reply
        self.lane = 0
        self.asked_at = 0.0
        self.quiet_until = 0.0
        self.silences = 0  # probes in a row without an answer
        self.probe_at = 0.0  # not before, while a group is read
        self.probes = 0  # sent so far


class SyncTable:
    """All nodes of a bus that were asked something; `out_of_sync` are the numbers of those not in sync."""

    def __init__(self, driver: BusDriver) -> None:
        self.driver = driver
        self.nodes: dict[int, NodeSync] = {}
        self.out_of_sync: set[int] = set()

    def of(self, number: int) -> NodeSync:
        node = self.nodes.get(number)
        if node is None:
            node = self.nodes[number] = NodeSync()
        return node

    def doubtful(self, request: Request[Any]) -> list[int]:
        """The nodes out of sync that owe a reply to this request."""
        if request.expected is ANY or not self.out_of_sync:
            return []
        return [due.node for due in request.expected if due.node in self.out_of_sync]

    def mark_sent(self, request: Request[Any], now: float) -> None:
        """A request leaves: its nodes are out of sync until they answer."""
        for due in request.expected if request.expected is not ANY else ():
            node = self.of(due.node)
            node.asked_at, node.lane = now, request.lane
            self.out_of_sync.add(due.node)

    def mark_owed(self, lane: int, due: Expected, quiet_until: float) -> None:
        """This reply did not come in time and may still come."""
        node = self.of(due.node)
        node.owed[lane, due.key, due.length] = None
        if due.refusal:
            node.owed[lane, due.key, due.refusal] = None
        node.quiet_until = quiet_until
        self.out_of_sync.add(due.node)

    def mark_recent(self, now: float, quiet: float, lane: int | None = None) -> None:
        """Unexpected data came: every node asked within the quiet time, on this lane, may have sent it."""
        for number, node in self.nodes.items():
            if lane in (None, node.lane) and now - node.asked_at <= quiet and number not in self.out_of_sync:
                self.out_of_sync.add(number)
                node.quiet_until = now + quiet

    def mark_all(self, quiet_until: float) -> None:
        """The port was lost and is back: what any node owes may still come."""
        for node in self.nodes.values():
            node.quiet_until = quiet_until
            node.silences = 0
        self.out_of_sync.update(self.nodes)

    def confirm(self, due: Expected, *, probe: bool) -> None:
        """This reply was accepted. A node that owes others is in sync again only after a probe."""
        node = self.of(due.node)
        node.length = due.length
        if probe:
            node.owed.clear()
        if not node.owed:
            self.out_of_sync.discard(due.node)
            node.silences = 0

    def take_owed(self, lane: int, key: Key, length: int) -> bool:
        """Whether a node owes a reply of this kind; it is settled then."""
        kind = lane, key, length
        for number in self.out_of_sync:
            if kind in self.nodes[number].owed:
                del self.nodes[number].owed[kind]
                return True
        return False

    def next_probe(self, number: int) -> Request[bool]:
        """A probe of this node whose reply it does not owe; where it owes all of them, the longest owed."""
        node = self.of(number)
        owed: dict[Kind, Request[bool]] = {}
        first: Request[bool] | None = None
        for _ in range(PROBES):
            probe = self.driver.probe(number, node.probes)
            first = first or probe
            if owed and probe.wire == first.wire:  # all probes of the family were compared
                break
            node.probes += 1
            kind = kind_of(probe)
            if kind not in node.owed:
                return probe
            if kind not in owed:
                owed[kind] = probe
        return next(owed[kind] for kind in node.owed if kind in owed)

    def back_off(self, number: int, now: float, quiet: float) -> None:
        """A probe was not answered: probe this node less often while groups are read."""
        node = self.of(number)
        node.silences += 1
        node.quiet_until = now
        node.probe_at = now + min(quiet * 2.0 ** min(node.silences, 10), LONGEST_BACK_OFF)


def kind_of(probe: Request[bool]) -> Kind:
    """The kind of the only reply to a probe."""
    (due,) = probe.expected  # type: ignore[misc]  # a probe has one reply
    assert not due.refusal, "a probe accepts no refusal"
    return probe.lane, due.key, due.length
