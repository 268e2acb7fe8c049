"""The least that speaks like servos on a CAN bus: a lane for each node, reports between replies, a hold for a stop.

A request goes to 0x600 + node (0: everyone), its answer comes from 0x580 + node; the first two bytes say what was
asked. Object 2 is the position, object 3 the goal, object 0 the node's own number.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorbus.bus.pump import Bus
from motorbus.bus.ticket import Flight
from motorbus.bus.turns import Turns
from motorbus.core.can_bits import bits, least
from motorbus.core.family import LinkNeeds, SimulatedNode, Stop
from motorbus.core.operation import (
    ANY,
    EVERY_LANE,
    Answer,
    CanFrame,
    Data,
    Due,
    Effect,
    Event,
    Exchange,
    Goal,
    Noise,
    Notice,
    Rank,
    Reply,
    Timeout,
)
from motorbus.link.memory import MemoryLink
from tests.bus.script import admit_all

READ, WRITE = 0x40, 0x22
NUMBER, POSITION, GOAL = 0, 2, 3
RATE = 500_000


def frame(node: int, kind: int, what: int, value: int = 0) -> CanFrame:
    """A request."""
    return CanFrame(0x600 + node, bytes((kind, what, 0, 0)) + value.to_bytes(4, "little", signed=True))


def said(node: int, kind: int, what: int, value: int = 0) -> CanFrame:
    """An answer."""
    return frame(node, kind, what, value)._replace(id=0x580 + node)


def number(answer: Answer) -> int:
    """The value in the first answer."""
    return int.from_bytes(answer.replies[0].data[4:8], "little", signed=True)


def read(node: int, what: int = POSITION, **options: Any) -> Exchange[int]:
    """Read an object of one node."""
    return Exchange(
        frame(node, READ, what),
        (Due(node, (READ, what), 8),),
        number,
        lane=node,
        repeatable=True,
        tells_position=what == POSITION,
        **options,
    )


def move(node: int, to: int, *, rank: Rank = Rank.CONTROL) -> Exchange[Answer]:
    """Order a goal."""
    return Exchange(
        frame(node, WRITE, GOAL, to),
        (Due(node, (WRITE, GOAL), 8),),
        lane=node,
        rank=rank,
        effect=Effect.MOTION,
        goals=() if rank is Rank.STOP else (Goal(node, "position", to, -900, 900),),
        repeatable=True,
    )


def everyone(what: int = NUMBER) -> Exchange[Answer]:
    """Read an object of whoever is there."""
    return Exchange(frame(0, READ, what), ANY, lane=EVERY_LANE, timeout=Timeout.SCAN)


class Frames:
    """The receiver."""

    held = 0

    def feed(self, data: Data) -> list[Event]:
        if not isinstance(data, CanFrame) or data.id - 0x580 not in range(1, 128):
            return [Noise(data.data if isinstance(data, CanFrame) else data, "foreign")]
        node = data.id - 0x580
        if len(data.data) == 4:
            return [Notice(node, "report", data.data)]
        return [Reply(node, (data.data[0], data.data[1]), data.data)]

    def flush(self) -> list[Event]:
        return []


class Lanes:
    """As much of a family as a bus asks for."""

    name = "lanes"

    def __init__(self, window: int = 16) -> None:
        self.link = LinkNeeds("frames", RATE, window=window)
        self.stops: list[dict[int, bool]] = []

    def air_time(self, exchange: Exchange[Any], rate: int) -> float:
        assert isinstance(exchange.request, CanFrame)
        dues = () if exchange.replies is ANY else exchange.replies
        return (bits(exchange.request) + sum(least(due.length) for due in dues)) / rate

    def turnaround(self, exchange: Exchange[Any]) -> float:
        return 0.002

    def quiet_time(self, rate: int) -> float:
        return 0.02

    def receiver(self) -> Frames:
        return Frames()

    def probe(self, node: int, attempt: int) -> Exchange[bool]:
        what = 0x80 | attempt & 0x7F
        return Exchange(
            frame(node, READ, what),
            (Due(node, (READ, what), 8),),
            lambda answer: number(answer) == what,
            lane=node,
        )

    def stop(self, nodes: Mapping[int, Answer | None]) -> Stop:
        """Hold a node where it is; ask one that nobody knows the place of."""
        self.stops.append({node: answer is not None for node, answer in nodes.items()})
        exchanges: list[Exchange[Answer]] = []
        for node, answer in nodes.items():
            if answer is not None:
                exchanges.append(move(node, number(answer), rank=Rank.STOP))
            else:
                asked = read(node, rank=Rank.STOP)
                exchanges.append(
                    Exchange(asked.request, asked.replies, lane=node, rank=Rank.STOP, tells_position=True)
                )
        return Stop(tuple(exchanges), "each holds where it was")


class Nodes:
    """The simulator: every node answers after `delay` seconds; `positions` are what they show and where they go."""

    def __init__(self, ids: tuple[int, ...] = (1, 2, 3, 4), delay: float = 0.0001) -> None:
        self.positions = {node: 100 * node for node in ids}
        self.delay = delay
        self.dead: set[int] = set()
        self.mute: set[int] = set()
        self.heard: list[CanFrame] = []
        self.rate = 0
        self.coming: list[tuple[float, Data]] = []
        self.nodes: Mapping[int, SimulatedNode] = {}

    def tune(self, rate: int) -> None:
        self.rate = rate

    def receive(self, data: Data, at: float) -> None:
        assert isinstance(data, CanFrame)
        self.heard.append(data)
        for node in self.positions:
            if data.id - 0x600 in (0, node) and node not in self.dead:
                self._obey(node, data.data, at)

    def _obey(self, node: int, data: bytes, at: float) -> None:
        kind, what, value = data[0], data[1], int.from_bytes(data[4:8], "little", signed=True)
        if (kind, what) == (WRITE, GOAL):
            self.positions[node] = value
        shown = {NUMBER: node, POSITION: self.positions[node]}.get(what, what)
        if node not in self.mute:
            self.coming.append((at + self.delay, said(node, kind, what, shown if kind == READ else 0)))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = sorted((item for item in self.coming if item[0] <= to), key=lambda item: item[0])
        self.coming = [item for item in self.coming if item[0] > to]
        return ready

    def due(self) -> float | None:
        return min((when for when, _ in self.coming), default=None)

    def orders(self, node: int) -> list[int]:
        """The goals that were ordered of it."""
        return [
            int.from_bytes(one.data[4:8], "little", signed=True)
            for one in self.heard
            if one.id == 0x600 + node and one.data[:2] == bytes((WRITE, GOAL))
        ]

    def asked(self, node: int) -> int:
        """How often it was asked for its position."""
        return sum(one == frame(node, READ, POSITION) for one in self.heard)


def can_bus(nodes: Nodes | None = None, *, window: int = 16, **options: Any) -> tuple[Bus, Nodes]:
    """A bus over such nodes in virtual time."""
    nodes = nodes or Nodes()
    family: Any = Lanes(window)
    return Bus(MemoryLink(nodes, rate=RATE, **options), family, admit=admit_all), nodes


class CanScript:
    """Turns of such a family and a hand-moved clock."""

    def __init__(self, window: int = 16, **options: Any) -> None:
        family: Any = Lanes(window)
        self.turns = Turns(family, rate=RATE, **{"admit": admit_all, **options})
        self.now = 100.0

    def submit(self, exchange: Exchange[Any], owner: object = None) -> Flight:
        flight = Flight(exchange, owner)
        self.turns.submit(flight, self.now)
        return flight

    def sent(self) -> list[int]:
        """To whom something goes out now."""
        out = []
        while (data := self.turns.send(self.now)) is not None:
            assert isinstance(data, CanFrame)
            self.turns.left(self.now)
            out.append(data.id - 0x600)
        return out

    def feed(self, *frames: CanFrame, after: float = 0.0005) -> None:
        self.now += after
        self.turns.feed(list(frames), self.now)

    def time_out(self) -> None:
        """Let the next deadline pass."""
        self.now = self.turns.due()
        self.turns.expire(self.now)
