"""Whom an emergency stop must reach, where each of them was last seen, how often each was stopped, and what a stop
waits for.

A node is known once it has answered or has been ordered to move. Where it was seen counts only while that is fresh
and nothing has set it moving since: holding a device at a place it has left would be an order to go back.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from motorbus.bus.ticket import Flight
from motorbus.core.family import Family
from motorbus.core.operation import ANY, Answer, Effect, Exchange, Rank

FRESH = 0.02  # s; an older position is not where a moving device is
MOVING = (Effect.TORQUE, Effect.MOTION)


class Known(dict[int, Answer | None]):
    """Nodes with their last answer that told a position.

    `seen` has the last exchange that told where a node is, with its answer, also when it was ordered to move since.
    `rate` is the bit rate at which one was last heard. `frames` stop everybody known, without a position: they are
    made when a node becomes known, for the case that a stop cannot make new ones. `stopping` counts the stops that
    have left, whomever they were for.
    """

    def __init__(self, family: Family, rate: int) -> None:
        super().__init__()
        self.family = family
        self.rate = rate
        self.frames = family.stop({})
        self.seen: dict[int, tuple[Exchange[Any], Answer]] = {}
        self._stops: Counter[int | None] = Counter()  # those for everybody under None
        self.stopping = 0

    def heard(self, nodes: Sequence[int], exchange: Exchange[Any], answer: Answer, rate: int) -> None:
        """These nodes have answered this exchange, and can be believed."""
        if not exchange.tells_position:
            self.hear_all(nodes, None, rate)
            return
        self.seen.update(dict.fromkeys(nodes, (exchange, answer)))
        self.hear_all(nodes, answer, rate)

    def hear(self, node: int, position: Answer | None, rate: int) -> None:
        """This node has answered, or has been ordered to move (None)."""
        self.hear_all((node,), position, rate)

    def hear_all(self, nodes: Iterable[int], position: Answer | None, rate: int) -> None:
        """The same of several, which one answer told of."""
        self.rate = rate
        for node in nodes:
            if node not in self:
                self[node] = position
                self.frames = self.family.stop(dict.fromkeys(self))
            elif position is not None:
                self[node] = position

    def order(self, exchange: Exchange[Any], rate: int) -> None:
        """An exchange leaves that may set something moving: whom it orders is known, and is not where it was."""
        ordered = [goal.node for goal in exchange.goals]
        if ordered:
            self.hear_all(ordered, None, rate)
        if exchange.effect not in MOVING:
            return
        if exchange.rank is Rank.STOP:
            self._stops.update(named(exchange) or (None,))
            self.stopping += 1
            return
        nodes = named(exchange) if exchange.replies else ordered
        for node in nodes or list(self):  # one that names nobody may move everybody
            if node in self:
                self[node] = None

    def fresh(self, now: float) -> dict[int, Answer | None]:
        """Everybody, with the last position if that is fresh, else None."""
        return {
            node: answer if answer is not None and now - answer.at < FRESH else None
            for node, answer in self.items()
        }

    def stops(self, node: int) -> int:
        """How many stops have left for this node, those for everybody included."""
        return self._stops.get(node, 0) + self._stops.get(None, 0)


def rest_of(flight: Flight, family: Family, rate: int, now: float) -> float:
    """s that a stop waits for what is on the line: a reply, or the rest of a request where both ways are open."""
    if not family.link.both_ways:
        return family.air_time(flight.exchange, rate)
    request: Exchange[Answer] = Exchange(flight.exchange.request)
    return max(0.0, flight.sent_at + family.air_time(request, rate) - now)


def named(exchange: Exchange[Any]) -> set[int]:
    """Who answers this exchange, or is ordered something by it; empty where it may be for everybody."""
    nodes = {goal.node for goal in exchange.goals}
    if exchange.replies is not ANY:
        nodes.update([due.node for due in exchange.replies])
    return nodes


def withdraws(stop: Exchange[Any], exchange: Exchange[Any]) -> bool:
    """This stop is for a node that the exchange, which was asked for before it, would move or give torque.

    One that names nobody is for everybody.
    """
    if stop.effect not in MOVING or exchange.effect not in MOVING or exchange.rank is Rank.STOP:
        return False
    stopped, ordered = named(stop), named(exchange)
    return not stopped or not ordered or bool(stopped & ordered)
