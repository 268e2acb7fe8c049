"""A request that is repeated: what does not change between two runs of it on one bus is computed once."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, Final

from motorbus.bus.attempt import Attempt
from motorbus.bus.statistics import BUCKETS
from motorbus.bus.sync import NodeSync
from motorbus.core.operation import ANY, Answer, CanFrame, Data, Exchange, Reply, Whole


class Prepared:
    """A request whose complete reply one function decodes. It belongs to one bus.

    `budget` is s from the write to the deadline at `timing`, the version of rate and latency. `alternate` is the same
    request with a reply of another length, itself where there is none. `record` is the one of the two that keeps the
    last reply: `data`, which `source` asked for, its arrival `at` (s) and the number of `orders` sent before it, and
    the replies by `latency` bucket that are not yet in the statistics.
    """

    __slots__ = (
        "alternate",
        "at",
        "attempt",
        "budget",
        "counted",
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
        "record",
        "single",
        "source",
        "states",
        "tells_position",
        "timing",
        "wire",
    )

    def __init__(
        self, engine: object, exchange: Exchange[Any], decode: Whole[Any], nodes: Mapping[int, NodeSync]
    ) -> None:
        dues = exchange.replies
        assert dues is not ANY
        self.engine: Final = engine
        self.exchange: Final = exchange
        self.wire: Final = exchange.request
        self.lane: Final = exchange.lane
        self.decode: Final = decode
        self.nodes: Final = tuple(due.node for due in dues)
        self.states: Final = [nodes[due.node] for due in dues]
        self.single: Final = self.states[0] if len(dues) == 1 else None
        self.length: Final = dues[0].length
        self.tells_position: Final = bool(exchange.tells_position)
        self.alternate = self.record = self.source = self
        self.attempt = Attempt(exchange, None)
        self.timing = -1
        self.budget = 0.0
        self.data: Data = b""
        self.at = -inf
        self.orders = 0
        self.kept: Answer | None = None
        self.latency = [0] * BUCKETS
        self.counted = False

    def answer(self) -> Answer:
        """The last reply, split into the replies of the nodes."""
        if self.kept is None:
            self.kept = Answer(split(self.source.exchange, self.data), (), self.at)
        return self.kept


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
