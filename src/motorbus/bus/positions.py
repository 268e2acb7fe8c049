"""What an emergency stop needs to know: which nodes are there, their last positions, and the stops sent to each.

A node is known once it has answered or was ordered to move. Its position counts while it is fresh and no order to this
node has left since: a goal at an old position would be an order to move back.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from motorbus.bus.jobs import StopCounts
from motorbus.bus.prepared import Prepared
from motorbus.core.family import BusDriver, Stop
from motorbus.core.request import ANY, Effect, Expected, Priority, Request, Response
from motorbus.core.setpoint import Setpoint, Stays

FRESH: Final = 0.02
"""s; a position older than this is not where a moving device is."""
GATED: Final = (Effect.MOTION, Effect.TORQUE)
"""Effects that the interlock judges and a stop ends."""
ENDLESS: Final = ("velocity", "load", "current")
"""Quantities that a device obeys until another order comes."""

Reading = tuple[Request[Any], Response]


class LastPositions(Mapping[int, Reading]):
    """By node, the last request that read a position and its reply.

    `rate` is the bit rate (bit/s) at which a node answered last. `orders` and `stop_total` count all orders and stops
    sent. `latest` is the source of each reading. `nodes` and `stops` are replaced, never changed: the stop thread reads
    them at any time.
    """

    def __init__(self, driver: BusDriver, rate: int) -> None:
        self.driver = driver
        self.rate = rate
        self.nodes: frozenset[int] = frozenset()
        self.orders = self.stop_total = 0
        self.stops: StopCounts = {}
        self.latest: dict[int, Prepared | tuple[Request[Any], Response, int]] = {}
        self._ordered: dict[tuple[int, ...], int] = {}  # by the nodes that an order was for (empty: all)
        self._accepted: Counter[int] = Counter()
        self._acknowledged: dict[int, Response] = {}  # the reply to the last order of a node
        self._stop_replies: dict[int, set[Expected]] = {}  # of a stop that takes several requests

    # -- positions ---------------------------------------------------------------------------------------------

    def __getitem__(self, node: int) -> Reading:
        return self._reading(node)[:2]

    def __iter__(self) -> Iterator[int]:
        return iter(tuple(self.latest))

    def __len__(self) -> int:
        return len(self.latest)

    def _reading(self, node: int) -> tuple[Request[Any], Response, int]:
        latest = self.latest[node]
        return latest.reading() if isinstance(latest, Prepared) else latest

    def answered(self, nodes: Iterable[int], request: Request[Any], answer: Response, rate: int) -> None:
        """These nodes answered this request."""
        self.rate = rate
        self.add(nodes)
        if request.effect in GATED:
            self._acknowledged.update(dict.fromkeys(nodes, answer))
        if request.reports_position and not _is_refusal(request, answer):
            self.latest.update(dict.fromkeys(nodes, (request, answer, self.orders)))

    def add(self, nodes: Iterable[int]) -> None:
        """These nodes exist."""
        if not self.nodes.issuperset(nodes):
            self.nodes = self.nodes.union(nodes)

    def fresh(self, now: float) -> dict[int, Response | None]:
        """Every known node with its last position, None where it is older than `FRESH` or an order has left since."""
        found: dict[int, Response | None] = dict.fromkeys(sorted(self.nodes))
        for node in self:
            _, answer, orders = self._reading(node)
            if now - answer.at < FRESH and orders >= self._last_order(node):
                found[node] = answer
        return found

    def _last_order(self, node: int) -> int:
        """The number of the last order that this node was given; 0 for none."""
        orders = tuple(self._ordered.items())  # the stop thread may ask while an order leaves
        return max((number for nodes, number in orders if not nodes or node in nodes), default=0)

    def forget(self) -> None:
        """The devices may have restarted: no position or acknowledgement counts any more."""
        self.latest.clear()
        self._acknowledged.clear()
        self._stop_replies.clear()

    # -- orders and stops --------------------------------------------------------------------------------------

    def sent(self, request: Request[Any]) -> None:
        """A request leaves that may move something, or stops it.

        The last position and acknowledgement of the nodes of an order (none: all) count no longer.
        """
        if request.priority is Priority.STOP:
            if request.effect in GATED:
                stops = Counter(self.stops)
                stops.update(addressed(request) or (None,))
                self.stops, self.stop_total = stops, self.stop_total + 1
            return
        nodes = tuple(request.setpoint_nodes)
        if not self.nodes.issuperset(nodes):
            self.add(nodes)
        if request.effect in GATED:
            if request.expected:
                nodes = tuple(addressed(request))
            self.orders += 1
            self._ordered[nodes] = self.orders
            for replies in (self._acknowledged, self._stop_replies):
                for node in (nodes or self.nodes) if replies else ():
                    replies.pop(node, None)

    def stop_count(self, node: int) -> int:
        """Number of stops sent to this node, those for all nodes included."""
        return self.stops.get(node, 0) + self.stops.get(None, 0)

    def is_stopped(self, request: Request[Any], before: StopCounts) -> bool:
        """A stop for a node that this request addresses was sent since `stops` was `before`."""
        if before is self.stops:
            return False
        nodes = addressed(request)
        return not nodes or any(before.get(node, 0) != self.stops.get(node, 0) for node in (*nodes, None))

    def frames(self, now: float) -> Stop:
        """Requests that stop all known nodes; without positions where the family fails to use them."""
        try:
            return self.driver.stop(self.fresh(now))
        except Exception:  # the stop must go out
            return self.driver.stop(dict.fromkeys(sorted(self.nodes)))

    def accept(self, request: Request[Any], answer: Response) -> None:
        """This request was answered and not refused: nodes that it stops have accepted a stop."""
        if request.effect not in GATED or request.expected is ANY:
            return
        answered = [due for due in request.expected if self._acknowledged.get(due.node) is answer]
        if request.priority is Priority.STOP:
            for due in answered:
                replies = self._stop_replies.setdefault(due.node, set())
                replies.add(due)
                if len(replies) >= self._stop_reply_count(due.node):
                    self.accepted(due.node)
        elif request.deferred is None:
            resting = {goal.node for goal in request.setpoints if rests(goal)}
            for due in answered:
                if due.node in resting:
                    self.accepted(due.node)

    def forget_stop_replies(self) -> None:
        """A new stop begins: replies to an earlier one do not count for it."""
        self._stop_replies.clear()

    def accepted(self, node: int) -> None:
        """This node acknowledged a stop."""
        self._stop_replies.pop(node, None)
        self._accepted[node] += 1

    def accepted_count(self, node: int) -> int:
        """Number of stops that this node has acknowledged."""
        return self._accepted[node]

    def _stop_reply_count(self, node: int) -> int:
        """Number of different replies that this node gives to the requests of a stop."""
        requests = self.driver.stop(dict.fromkeys(sorted(self.nodes))).requests
        gated = [one.expected for one in requests if one.effect in GATED and one.expected is not ANY]
        return max(1, len({due for dues in gated for due in dues if due.node == node}))


def _is_refusal(request: Request[Any], answer: Response) -> bool:
    """The only reply has the length of a refusal."""
    if request.expected is ANY or len(request.expected) != 1 or not answer.replies:
        return False
    return len(answer.replies[0].data) == request.expected[0].refusal


def rests(goal: Setpoint) -> bool:
    """A device that obeys this goal moves no more."""
    return goal.stays is Stays.STILL or (goal.quantity in ENDLESS and not goal.value)


def moves(request: Request[Any]) -> bool:
    """The request moves something or switches torque on."""
    if request.effect not in GATED or request.priority is Priority.STOP:
        return False
    return request.prechecked or not request.setpoints or not all(map(rests, request.setpoints))


def addressed(request: Request[Any]) -> set[int]:
    """Nodes that answer this request or are ordered something by it; empty for all nodes."""
    nodes = {goal.node for goal in request.setpoints}
    if request.expected is not ANY:
        nodes.update(due.node for due in request.expected)
    return nodes
