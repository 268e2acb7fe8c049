"""What a bus remembers of its nodes for the emergency stop and the gate: their last positions, orders and stops.

A node is known once it has answered or was ordered to move. Its position counts while it is fresh and no order to this
node has left since: a goal at an old position would be an order to move back.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from motorbus.bus.attempt import Attempt
from motorbus.core.family import BusDriver, Stop
from motorbus.core.request import ANY, Effect, Priority, Request, Response
from motorbus.core.setpoint import Setpoint, Stays

FRESH: Final = 0.02
"""s; a position older than this is not where a moving device is."""
GATED: Final = (Effect.MOTION, Effect.TORQUE)
"""Effects that the interlock judges and a stop ends."""
ENDLESS: Final = ("velocity", "load", "current")
"""Quantities that a device obeys until another order comes."""

Reading = tuple[Request[Any], Response]


class Nodes(Mapping[int, Reading]):
    """By node, the last request that read a position and its reply.

    `known` are the nodes that exist, `rate` is the bit rate (bit/s) at which one answered last. `epoch` counts stops,
    latches and lost ports. `known` and `stops` are replaced, never changed: the stop thread reads them at any time.
    """

    def __init__(self, driver: BusDriver, rate: int) -> None:
        self.driver = driver
        self.rate = rate
        self.known: frozenset[int] = frozenset()
        self.orders = 0
        self.epoch = self.stopped_all = 0
        self.stops: dict[int, int] = {}
        """By node, the epoch of its last stop; `stopped_all` is that of the last stop of all."""
        self.sources: dict[int, Attempt] = {}
        """By node, the last accepted attempt that read its position."""
        self._ordered: dict[tuple[int, ...], int] = {}  # by the nodes that an order was for (empty: all)

    # -- positions ---------------------------------------------------------------------------------------------

    def __getitem__(self, node: int) -> Reading:
        return self.sources[node].reading()

    def __iter__(self) -> Iterator[int]:
        return iter(tuple(self.sources))

    def __len__(self) -> int:
        return len(self.sources)

    def add(self, nodes: Iterable[int]) -> None:
        """These nodes exist."""
        if not self.known.issuperset(nodes):
            self.known = self.known.union(nodes)

    def fresh(self, now: float) -> dict[int, Response | None]:
        """Every known node with its last position, None where it is older than `FRESH` or an order has left since."""
        found: dict[int, Response | None] = dict.fromkeys(sorted(self.known))
        for node, source in tuple(self.sources.items()):
            answer = source.reading()[1]
            if now - answer.at < FRESH and source.orders >= self._last_order(node):
                found[node] = answer
        return found

    def _last_order(self, node: int) -> int:
        """The number of the last order that this node was given; 0 for none."""
        orders = tuple(self._ordered.items())  # the stop thread may ask while an order leaves
        return max((number for nodes, number in orders if not nodes or node in nodes), default=0)

    # -- orders and stops --------------------------------------------------------------------------------------

    def ordered(self, request: Request[Any]) -> None:
        """An order leaves: positions read before it count no longer for its nodes."""
        nodes = tuple(request.setpoint_nodes)
        if not self.known.issuperset(nodes):
            self.known = self.known.union(nodes)
        if request.effect in GATED:
            if request.expected:
                nodes = tuple(addressed(request))
            self.orders += 1
            self._ordered[nodes] = self.orders

    def stopped(self, request: Request[Any]) -> None:
        """A stop leaves: motion of its nodes that waits to be sent is withdrawn."""
        self.epoch += 1
        nodes = addressed(request)
        if nodes:
            self.stops = self.stops | dict.fromkeys(nodes, self.epoch)
        else:
            self.stopped_all = self.epoch

    def last_stop(self, node: int) -> int:
        """The epoch of the last stop of this node."""
        return max(self.stops.get(node, 0), self.stopped_all)

    def is_stopped(self, request: Request[Any], since: int) -> bool:
        """A node of this request, which moves something, was stopped after this epoch."""
        nodes = addressed(request) or self.stops.keys()
        return self.stopped_all > since or any(self.stops.get(node, 0) > since for node in nodes)

    def stop_requests(self, now: float, nodes: Iterable[int]) -> Stop:
        """Requests that stop these nodes; without positions where the family fails to use them."""
        fresh = self.fresh(now)
        wanted = {node: fresh.get(node) for node in sorted(nodes)}
        try:
            return self.driver.stop(wanted)
        except Exception:  # the stop must go out
            return self.driver.stop(dict.fromkeys(wanted))


def rests(goal: Setpoint) -> bool:
    """A device that obeys this goal moves no more."""
    return goal.stays is Stays.STILL or (goal.quantity in ENDLESS and not goal.value)


def moves(request: Request[Any]) -> bool:
    """The request moves something or switches torque on."""
    if request.effect not in GATED or request.priority is Priority.STOP:
        return False
    return not request.setpoints or not all(map(rests, request.setpoints))


def addressed(request: Request[Any]) -> set[int]:
    """Nodes that answer this request or are ordered something by it; empty for all nodes."""
    nodes = set(request.setpoint_nodes)
    if request.expected is not ANY:
        nodes.update(due.node for due in request.expected)
    return nodes


def is_refusal(request: Request[Any], answer: Response) -> bool:
    """The only reply has the length of a refusal."""
    if request.expected is ANY or len(request.expected) != 1 or not answer.replies:
        return False
    return len(answer.replies[0].data) == request.expected[0].refusal
