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
from motorbus.core.goal import Stays
from motorbus.core.operation import ANY, Answer, Due, Effect, Exchange, Goal, Rank

FRESH = 0.02  # s; an older position is not where a moving device is
MOVING = (Effect.TORQUE, Effect.MOTION)
ENDLESS = (
    "velocity",
    "load",
    "current",
)  # quantities that go on being obeyed until something else is ordered


class Known(dict[int, Answer | None]):
    """Nodes with their last answer that told a position.

    Who looks has the lock of the turns, so that what was put off is there; see `course.TurnsLock`.

    `seen` has the last exchange that told where a node is, with its answer, also when it was ordered to move since.
    `rate` is the bit rate at which one was last heard. `frames` stop everybody known, without a position: they are
    made when a node becomes known, for the case that a stop cannot make new ones. `stopping` counts the stops that
    have left, whomever they were for; `accepts` those that a node has answered.
    """

    def __init__(self, family: Family, rate: int) -> None:
        super().__init__()
        self.family = family
        self.rate = rate
        self.frames = family.stop({})
        self.seen: dict[int, tuple[Exchange[Any], Answer]] = {}
        self._stops: Counter[int | None] = Counter()  # those for everybody under None
        self._accepted: Counter[int] = Counter()
        self._given: dict[
            int, set[Due]
        ] = {}  # what a node has answered of a stop that takes several exchanges
        self._said: dict[int, Answer] = {}  # the answer to the last order of a node, while no other has left
        self.stopping = 0

    def heard(self, nodes: Sequence[int], exchange: Exchange[Any], answer: Answer, rate: int) -> None:
        """These nodes have answered this exchange, and can be believed."""
        if exchange.effect in MOVING:
            self._said.update(dict.fromkeys(nodes, answer))
        if not exchange.tells_position:
            self.hear_all(nodes, None, rate)
            return
        self.seen.update(dict.fromkeys(nodes, (exchange, answer)))
        self.hear_all(nodes, answer, rate)

    def saw(self, nodes: Sequence[int], exchange: Exchange[Any], answer: Answer) -> None:
        """These nodes, which are known, have told their positions."""
        self.seen.update(dict.fromkeys(nodes, (exchange, answer)))
        self.update(dict.fromkeys(nodes, answer))

    def hear(self, node: int, position: Answer | None, rate: int) -> None:
        """This node has answered, or has been ordered to move (None)."""
        self.hear_all((node,), position, rate)

    def hear_all(self, nodes: Iterable[int], position: Answer | None, rate: int) -> None:
        """The same of several, which one answer told of."""
        self.rate = rate
        if position is None and self.keys() >= set(nodes):
            return
        for node in nodes:
            if node not in self:
                self[node] = position
                self.frames = self.family.stop(dict.fromkeys(self))
            elif position is not None:
                self[node] = position

    def order(self, exchange: Exchange[Any], rate: int) -> None:
        """An exchange leaves that may set something moving: whom it orders is known, and is not where it was."""
        ordered = exchange.ordered
        if ordered and exchange.rank is not Rank.STOP:
            self.hear_all(ordered, None, rate)
        if exchange.effect not in MOVING:
            return
        if exchange.rank is Rank.STOP:
            self._stops.update(named(exchange) or (None,))
            self.stopping += 1
            return
        nodes = named(exchange) if exchange.replies else ordered
        self.moves(nodes or list(self))  # one that names nobody may move everybody

    def moves(self, nodes: Iterable[int]) -> None:
        """These may be anywhere from now on, and what they said last was not about this order."""
        self.follow(nodes)
        self.update(dict.fromkeys(self.keys() & nodes))

    def follow(self, nodes: Iterable[int]) -> None:
        """These were ordered something that they did not answer; where they are is about to be told anyway."""
        for said in (self._said, self._given):
            for node in nodes if said else ():
                said.pop(node, None)

    def forget(self) -> None:
        """Whoever is there may have started anew: where they are and what they said last counts no more."""
        self.update(dict.fromkeys(self))
        self.seen.clear()
        self._said.clear()
        self._given.clear()

    def fresh(self, now: float) -> dict[int, Answer | None]:
        """Everybody, with the last position if that is fresh, else None."""
        return {
            node: answer if answer is not None and now - answer.at < FRESH else None
            for node, answer in self.items()
        }

    def accept(self, exchange: Exchange[Any], answer: Answer) -> None:
        """This has been answered, and not refused: whom it has told to stop, or to rest, has accepted that.

        An order that has left since has not been ended by it.
        """
        if exchange.effect not in MOVING or exchange.replies is ANY or not exchange.replies:
            return
        heard = [due for due in exchange.replies if self._said.get(due.node) is answer]
        if exchange.rank is Rank.STOP:
            for due in heard:
                given = self._given.setdefault(due.node, set())
                given.add(due)
                if len(given) >= self._kinds(due.node):
                    self.accepted(due.node)
        elif exchange.later is None:
            resting = {goal.node for goal in exchange.goals if rests(goal)}
            for node in resting.intersection(due.node for due in heard):
                self.accepted(node)

    def accepted(self, node: int) -> None:
        """It is certain that this node was told to stop."""
        self._given.pop(node, None)
        self._accepted[node] += 1

    def accepts(self, node: int) -> int:
        """How many stops this node has accepted. One that has left and was not answered is none of them."""
        return self._accepted[node]

    def _kinds(self, node: int) -> int:
        """How many kinds of replies a node gives to all that stops it."""
        dues = {
            due
            for frame in self.frames.exchanges
            if frame.effect in MOVING and frame.replies is not ANY
            for due in frame.replies
            if due.node == node
        }
        return max(1, len(dues))

    def stops(self, node: int) -> int:
        """How many stops have left for this node, those for everybody included."""
        return self._stops.get(node, 0) + self._stops.get(None, 0)


def rest_of(flight: Flight, family: Family, rate: int, now: float) -> float:
    """s that a stop waits for what is on the line: a reply, or the rest of a request where both ways are open."""
    if not family.link.both_ways:
        return family.air_time(flight.exchange, rate)
    request: Exchange[Answer] = Exchange(flight.exchange.request)
    return max(0.0, flight.sent_at + family.air_time(request, rate) - now)


def rests(goal: Goal) -> bool:
    """Whether whoever obeys this goal goes on no more."""
    return goal.stays is Stays.STILL or (goal.quantity in ENDLESS and not goal.value)


def moves(exchange: Exchange[Any]) -> bool:
    """Whether it sets something moving or gives it torque; what stops, or lets go, does not."""
    if exchange.effect not in MOVING or exchange.rank is Rank.STOP:
        return False
    return not exchange.goals or not all(map(rests, exchange.goals))


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
