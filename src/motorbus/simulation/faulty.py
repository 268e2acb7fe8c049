"""A simulated bus with faults: a `Simulator` around another one, and the `Line` between it and its host."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import inf
from random import Random
from typing import Any, Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.family import SimulatedNode, Simulator
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Side
from motorbus.simulation.faults import KINDS, Fault, Script, parse

BROKEN: Final = CanFrame(ERROR_FLAG | 0x88, bytes(8))
"""Report of an adapter about a broken CAN frame: protocol violation and bus error, the classes of SocketCAN."""
MAX_FIRED: Final = 1000


class Fired(NamedTuple):
    """A fault that happened, and when (s)."""

    at: float
    fault: Fault


class _Event(NamedTuple):
    at: float
    order: int
    act: Callable[[float], None]


class FaultyBus:
    """Carries out a script of faults; without one it changes nothing.

    `simulator`  the devices; their other attributes are those of this object
    `script`     the present faults
    `fired`      the latest faults that happened, at most 1000; `count` counts all
    `pending`    faults with a place or a moment that have not happened

    The same script and the same data give the same faults. `unplug` is called with a time (s) and unplugs the port;
    None: the port cannot be unplugged.
    """

    def __init__(self, simulator: Simulator, unplug: Callable[[float], None] | None = None) -> None:
        self.simulator = simulator
        self.script = Script()
        self.count = 0
        self.fired: deque[Fired] = deque(maxlen=MAX_FIRED)
        self.pending: list[Fault] = []
        self._unplug = unplug
        self._exchange = 0
        self._start = 0.0
        self._events: list[_Event] = []
        self._order = count()
        self._chances: list[tuple[Fault, Random]] = []
        self._not_before = {Side.HOST: -inf, Side.DEVICE: -inf}

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["simulator"], name)

    def set(self, script: Script | str, now: float) -> None:
        """Replace the faults from `now` (s) on; "" has none. Exchanges and times count from there.

        Raises RequestError for a bad script and for a fault that is not possible here; the former faults stay then.
        """
        given = parse(script) if isinstance(script, str) else script
        for fault in given.faults:
            self._check(fault)
        self.script, self._start, self._exchange = given, now, 0
        self._chances = [
            (fault, Random(f"{given.seed} {index} {fault}"))
            for index, fault in enumerate(given.faults)
            if fault.percent
        ]
        self.pending = [fault for fault in given.faults if not fault.percent]
        self._events = sorted(event for event in self._events if _is_plug(event))
        for fault in self.pending:
            if fault.moment is not None and not KINDS[fault.kind].packet:
                self._schedule(now + fault.moment, partial(self._happen, fault))

    def _check(self, fault: Fault) -> None:
        if fault.kind == "unplug" and self._unplug is None:
            raise RequestError(
                f"fault {str(fault)!r}: this port cannot be unplugged",
                cause="no program would find a pseudo-terminal without a link again, or the channel belongs to others",
                advice="serve the bus on a link or a TCP port",
            )
        if fault.node is not None and fault.node not in self.nodes:
            known = ", ".join(map(str, sorted(self.nodes)))
            raise RequestError(
                f"fault {str(fault)!r}: there is no device {fault.node}", expected=f"one of {known}"
            )

    # -- the simulator -------------------------------------------------------------------------------------------

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        """The devices by id."""
        return self.simulator.nodes

    def tune(self, rate: int) -> None:
        self.simulator.tune(rate)

    def receive(self, data: Data, at: float) -> None:
        self.simulator.receive(data, at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        sent: list[tuple[float, Data]] = []
        while self._events and self._events[0].at <= to:
            event = heappop(self._events)
            sent += self.simulator.advance(event.at)
            event.act(event.at)
        return sent + self.simulator.advance(to)

    def due(self) -> float | None:
        due = self.simulator.due()
        if not self._events:
            return due
        return self._events[0].at if due is None else min(due, self._events[0].at)

    # -- the line ------------------------------------------------------------------------------------------------

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        """Return what arrives of these data. See `link.base.Line`."""
        to = Side.DEVICE if sender is Side.HOST else Side.HOST
        if sender is Side.HOST:
            self._exchange += 1
        if not self.script.faults:
            return [Delivery(at, to, data)]
        copies, delay, echo = [data], 0.0, False
        for fault, random in self._striking(to, at):
            if not KINDS[fault.kind].packet:
                self._schedule(at, partial(self._happen, fault))
                continue
            self._record(fault, at)
            match fault.kind:
                case "drop":
                    copies = []
                case "corrupt":
                    copies = [_corrupt(copy, random) for copy in copies]
                case "duplicate":
                    copies += copies
                case "delay":
                    delay += random.uniform(fault.seconds, fault.until or fault.seconds)
                case "echo":
                    echo = True
        arrival = self._not_before[to] = max(at + delay, self._not_before[to])
        deliveries = [Delivery(at, Side.HOST, data)] if echo else []
        for copy in copies:
            receiver = Side.HOST if copy is BROKEN else to
            deliveries.append(Delivery(arrival, receiver, copy))
        return deliveries

    def _striking(self, to: Side, at: float) -> list[tuple[Fault, Random]]:
        """The faults of this packet."""
        found = [
            (fault, random)
            for fault, random in self._chances
            if fault.to is to and random.random() * 100 < fault.percent
        ]
        for fault in tuple(self.pending):
            is_due = fault.exchange == self._exchange
            if fault.moment is not None:
                is_due = KINDS[fault.kind].packet and self._start + fault.moment <= at
            if fault.to is to and is_due:
                self.pending.remove(fault)
                found.append((fault, Random(f"{self.script.seed} {fault}")))
        return found

    # -- devices and ports ---------------------------------------------------------------------------------------

    def _schedule(self, at: float, act: Callable[[float], None]) -> None:
        heappush(self._events, _Event(at, next(self._order), act))

    def _happen(self, fault: Fault, at: float) -> None:
        if fault in self.pending:
            self.pending.remove(fault)
        self._record(fault, at)
        nodes = [node for id, node in self.nodes.items() if fault.node in (None, id)]
        if fault.kind == "unplug" and self._unplug is not None:
            self._unplug(fault.seconds)
        elif fault.kind == "power-cycle":
            for node in nodes:
                node.power_cycle()
        elif fault.kind == "brown-out":
            for node in nodes:
                node.unplug()
            self._schedule(at + fault.seconds, partial(_plug, nodes))

    def _record(self, fault: Fault, at: float) -> None:
        self.count += 1
        self.fired.append(Fired(at, fault))


def _plug(nodes: list[SimulatedNode], at: float) -> None:
    for node in nodes:
        node.plug()


def _is_plug(event: _Event) -> bool:
    """Whether this event gives devices their supply back."""
    return getattr(event.act, "func", None) is _plug


def _corrupt(data: Data, random: Random) -> Data:
    """These data with one byte changed; a CAN frame becomes the report of a broken frame."""
    if isinstance(data, CanFrame):
        return BROKEN
    if not data:
        return data
    place = random.randrange(len(data))
    changed = data[place] ^ random.randrange(1, 256)
    return data[:place] + bytes([changed]) + data[place + 1 :]
