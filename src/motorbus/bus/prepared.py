"""A request that is repeated: what does not change between two runs of it on one bus is computed once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from motorbus.bus.jobs import Attempt
from motorbus.bus.sync import NodeSync
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, Data, ExactDecoder, Reply, Request, Response


@dataclass(slots=True, eq=False)
class Prepared:
    """A request whose complete reply one function decodes. It belongs to one bus.

    `budget` is s from the write to the deadline, at this `rate` and `latency`. `alternate` is the same request with a
    reply of another length, itself where there is none. `record` is the one of the two that keeps the last reply:
    `data`, which `source` asked for, its arrival `at` (s) and the number of `orders` sent before it. `times` counts
    replies by latency. `single` is the state of its node, None for a group. `length` is that of its first reply, `size`
    that of all (bytes).
    """

    engine: object
    request: Request[Any]
    decode: ExactDecoder[Any]
    nodes: tuple[int, ...]
    states: list[NodeSync]
    times: list[int]
    attempt: Attempt
    wire: Data = field(init=False)
    lane: int = field(init=False)
    length: int = field(init=False)
    size: int = field(init=False)
    single: NodeSync | None = field(init=False)
    alternate: Prepared = field(init=False)
    record: Prepared = field(init=False)
    source: Prepared = field(init=False)
    rate: int = 0
    latency: float = 0.0
    budget: float = 0.0
    data: Data = b""
    at: float = -inf
    orders: int = 0
    kept: Response | None = None

    def __post_init__(self) -> None:
        dues = self.request.expected
        assert dues is not ANY
        self.wire, self.lane, self.length = self.request.wire, self.request.lane, dues[0].length
        self.size = sum(due.length for due in dues)
        self.single = self.states[0] if len(dues) == 1 else None
        self.alternate = self.record = self.source = self

    def reading(self) -> tuple[Request[Any], Response, int]:
        """The request, its last reply, split into the replies of the nodes, and the orders sent before it."""
        request = self.source.request
        if self.kept is None:
            self.kept = Response(split(request, self.data), (), self.at)
        return request, self.kept, self.orders


def nodes_of(request: Request[Any]) -> tuple[int, ...]:
    """The nodes that answer this request, in the order expected."""
    dues: Sequence[Any] = () if request.expected is ANY else request.expected
    return tuple(due.node for due in dues)


def split(request: Request[Any], data: Data) -> tuple[Reply, ...]:
    """The complete reply as single replies, in the order expected."""
    dues = request.expected
    assert dues is not ANY
    content = data.data if isinstance(data, CanFrame) else data
    replies, start = [], 0
    for due in dues:
        replies.append(Reply(request.lane, due.key, content[start : start + due.length]))
        start += due.length
    return tuple(replies)
