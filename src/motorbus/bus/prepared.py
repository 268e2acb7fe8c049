"""A request that is repeated: what does not change between two runs of it on one bus is computed once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final

from motorbus.bus.attempt import Attempt
from motorbus.bus.sync import NodeSync
from motorbus.core.operation import ANY, Answer, CanFrame, Data, Exchange, Reply, Whole


class Prepared:
    """A request whose complete reply one function decodes. It belongs to one bus.

    `budget` is s from the write to the deadline, at this `rate` and `latency`. `alternate` is the same request with a
    reply of another length, itself where there is none. `record` is the one of the two that keeps the last reply:
    `data`, which `source` asked for, its arrival `at` (s) and the number of `orders` sent before it. `times` counts
    replies by latency.
    """

    __slots__ = (
        "alternate",
        "at",
        "attempt",
        "budget",
        "data",
        "decode",
        "engine",
        "exchange",
        "kept",
        "lane",
        "latency",
        "length",
        "nodes",
        "orders",
        "rate",
        "record",
        "single",
        "source",
        "states",
        "tells_position",
        "times",
        "wire",
    )

    def __init__(
        self,
        engine: object,
        exchange: Exchange[Any],
        decode: Whole[Any],
        states: Mapping[int, NodeSync],
        times: list[int],
    ) -> None:
        dues = exchange.replies
        assert dues is not ANY
        self.engine: Final = engine
        self.exchange: Final = exchange
        self.wire: Final = exchange.request
        self.lane: Final = exchange.lane
        self.decode: Final = decode
        self.nodes: Final = nodes_of(exchange)
        self.states: Final = [states[node] for node in self.nodes]
        self.single: Final = self.states[0] if len(dues) == 1 else None
        self.length: Final = dues[0].length
        self.tells_position: Final = bool(exchange.tells_position)
        self.times: Final = times
        self.alternate = self.record = self.source = self
        self.attempt = Attempt(exchange, None)
        self.rate, self.latency = 0, 0.0
        self.budget = 0.0
        self.data: Data = b""
        self.at = -inf
        self.orders = 0
        self.kept: Answer | None = None

    def reading(self) -> tuple[Exchange[Any], Answer, int]:
        """The request, its last reply, split into the replies of the nodes, and the orders sent before it."""
        exchange = self.source.exchange
        if self.kept is None:
            self.kept = Answer(split(exchange, self.data), (), self.at)
        return exchange, self.kept, self.orders


def nodes_of(exchange: Exchange[Any]) -> tuple[int, ...]:
    """The nodes that answer this request, in the order expected."""
    dues: Sequence[Any] = () if exchange.replies is ANY else exchange.replies
    return tuple(due.node for due in dues)


def split(exchange: Exchange[Any], data: Data) -> tuple[Reply, ...]:
    """The complete reply as single replies, in the order expected."""
    dues = exchange.replies
    assert dues is not ANY
    content = data.data if isinstance(data, CanFrame) else data
    replies, start = [], 0
    for _, key, length in dues:
        replies.append(Reply(exchange.lane, key, content[start : start + length]))
        start += length
    return tuple(replies)
