"""Which nodes are in sync. A state changes in `SyncTable._fire` only.

A node whose reply did not come in time owes it. Before the next request to it the bus is silent for a quiet time, then
sends a probe: a request whose reply differs in key or length from every reply that the node owes. A link is first in,
first out, so when the probe is answered no older reply can follow.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Final, TypeAlias

from motorbus.core.family import BusDriver
from motorbus.core.request import ANY, Effect, Expected, Key, Priority, Request, TimeoutClass

PROBES: Final = 64
"""Probes compared with what a node owes, to find one that differs."""
BACK_OFF: Final = 0.25
"""A silent node of a group is probed again after this part of its silence: twice at least before a control loop, which
ends after 0.3 s without a position, gives it up."""
LONGEST_BACK_OFF: Final = 1.0
"""s between probes of a silent node of a group."""

Kind: TypeAlias = "tuple[int, Key, int]"
"""Lane, key and length of a reply."""


class State(Enum):
    """State of a node: it may be asked, needs a probe first, or owes a reply and needs a probe first."""

    IN_SYNC = "in sync"
    DOUBTED = "doubted"
    OWING = "owing"


IN_SYNC, DOUBTED, OWING = State
MOVES: Final = {
    (IN_SYNC, "missed"): OWING,  # a reply did not come, or a copy of one may follow
    (DOUBTED, "missed"): OWING,
    (OWING, "missed"): OWING,
    (IN_SYNC, "doubted"): DOUBTED,  # it may have sent what was not expected
    (DOUBTED, "doubted"): DOUBTED,
    (OWING, "doubted"): OWING,
    (IN_SYNC, "answered"): IN_SYNC,
    (DOUBTED, "answered"): IN_SYNC,
    (OWING, "answered"): OWING,  # the older reply may still come
    (IN_SYNC, "probed"): IN_SYNC,
    (DOUBTED, "probed"): IN_SYNC,
    (OWING, "probed"): IN_SYNC,
}
"""State and event -> state."""


class NodeSync:
    """One node: what it owes (the oldest first), and when (s) it may be asked.

    Its first probe without an answer was at `silent_since`; a group does not wait for it before `probe_at`.
    """

    def __init__(self) -> None:
        self.state = IN_SYNC
        self.owed: dict[Kind, None] = {}
        self.quiet_until = self.silent_since = self.probe_at = 0.0
        self.probes = 0


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

    def _fire(self, number: int, event: str) -> NodeSync:
        node = self.of(number)
        node.state = MOVES[node.state, event]
        if node.state is IN_SYNC:
            self.out_of_sync.discard(number)
            node.owed.clear()
            node.silent_since = node.probe_at = 0.0
        else:
            self.out_of_sync.add(number)
        return node

    def mark_owed(self, lane: int, due: Expected, quiet_until: float) -> None:
        """This reply did not come in time, or was sent twice: it may still come."""
        node = self._fire(due.node, "missed")
        for key in (due.key, *due.refusals):
            node.owed[lane, key, due.length] = None
        if due.refusal:
            node.owed[lane, due.key, due.refusal] = None
        node.quiet_until = quiet_until

    def mark_doubted(self, number: int, quiet_until: float) -> None:
        """This node may have sent something unexpected."""
        if number not in self.out_of_sync:
            self._fire(number, "doubted").quiet_until = quiet_until

    def mark_all(self, quiet_until: float) -> None:
        """The port was lost and is back: what any node owes may still come."""
        for number in self.nodes:
            node = self._fire(number, "doubted")
            node.quiet_until, node.silent_since, node.probe_at = quiet_until, 0.0, 0.0

    def confirm(self, number: int, *, probe: bool) -> None:
        """A reply of this node was accepted. A node that owes others is in sync again only after a probe."""
        if number in self.out_of_sync:
            self._fire(number, "probed" if probe else "answered")

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
        wires: set[object] = set()
        while len(wires) < PROBES:
            probe = self.driver.probe(number, node.probes)
            if probe.wire in wires:  # all probes of the family were compared
                break
            wires.add(probe.wire)
            node.probes += 1
            kind = kind_of(probe)
            if kind not in node.owed:
                return probe
            owed[kind] = probe
        return next(owed[kind] for kind in node.owed if kind in owed)

    def back_off(self, number: int, now: float, quiet: float) -> None:
        """A probe was not answered: probe this node less often while groups are read."""
        node = self.of(number)
        node.quiet_until = now
        node.silent_since = node.silent_since or now
        pause = max(quiet, BACK_OFF * (now - node.silent_since))
        node.probe_at = now + min(pause, LONGEST_BACK_OFF)

    def is_put_off(self, number: int, now: float) -> bool:
        """A group does not wait for this node now: it was silent lately."""
        return now < self.nodes[number].probe_at


def kind_of(probe: Request[bool]) -> Kind:
    """The kind of the only reply to a probe."""
    (due,) = probe.expected  # type: ignore[misc]  # a probe has one reply
    assert not due.refusal, "a probe accepts no refusal"
    return probe.lane, due.key, due.length


def must_sync(request: Request[Any]) -> bool:
    """The nodes of this request must be in sync: not of a stop, nor of a scan, whose usual answer is silence."""
    return request.priority is not Priority.STOP and request.reply_within is not TimeoutClass.SCAN


def is_read(request: Request[Any]) -> bool:
    """Sending it again changes nothing."""
    return request.repeatable and request.effect is Effect.NONE
