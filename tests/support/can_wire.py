"""One CAN wire with true bit time between an adapter and simulated nodes.

A simulator says when a node is ready to send; on a real bus it then waits until the wire is idle and until every
frame with a lower identifier has passed. How fast many nodes can be read depends on just that, so this stands between
simulator and link wherever a figure is to be more than a guess. It is a simulator itself, in virtual time or real.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from heapq import heappop, heappush
from math import inf
from typing import NamedTuple

from motorbus.core.can_bits import INTERFRAME, bits, precedence
from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.family import SimulatedNode, Simulator
from motorbus.core.request import Data


class _Pending(NamedTuple):
    """A frame of a node that waits for the wire: least precedence, then first ready, goes first."""

    precedence: tuple[int, ...]
    number: int
    frame: CanFrame


class _OnWire(NamedTuple):
    """The frame that is being sent, and when its last bit has passed."""

    frame: CanFrame
    end: float
    by_host: bool


class CanWire:
    """A `Simulator` around another: the same nodes, behind one shared wire and an adapter.

    `simulator`  the nodes; the moment at which one of them begins to send is the moment at which it is ready to
    `latency`    s that the adapter takes for a frame in either direction, a pure delay: it holds nothing up

    The adapter sends what it is given in that order. Two nodes that are ready with one identifier send one after
    the other; what really happens then (an equal frame is one frame, another one an error) is the simulator's to say.
    `busy` is how long the wire has carried something (s), `carried` how many frames.
    """

    paced = True

    def __init__(self, simulator: Simulator, *, latency: float = 0.0005) -> None:
        self.simulator = simulator
        self.latency = latency
        self.rate = 0
        self.busy = 0.0
        self.carried = 0
        self._host: deque[tuple[float, CanFrame]] = deque()
        self._ready: list[_Pending] = []
        self._coming: list[tuple[float, int, CanFrame]] = []
        self._wire: _OnWire | None = None
        self._free_at = -inf
        self._out: deque[tuple[float, Data]] = deque()
        self._number = 0

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        """The simulated nodes."""
        return self.simulator.nodes

    def tune(self, rate: int) -> None:
        """The rate of the adapter, bit/s; it is that of the wire."""
        self.rate = rate
        self.simulator.tune(rate)

    def receive(self, data: Data, at: float) -> None:
        """The host hands a frame to the adapter."""
        if isinstance(data, CanFrame):
            self._host.append((at + self.latency, data))

    def due(self) -> float | None:
        """When the next frame begins, ends or reaches the host, or a node does something by itself."""
        moment = min(self._next(), self._out[0][0] if self._out else inf)
        return moment if moment < inf else None

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Everything that reaches the host up to this moment."""
        while (moment := self._next()) <= to:
            self._happen(moment)
        self._happen(to)  # the nodes learn what time it is even when nothing happens
        arrived = []
        while self._out and self._out[0][0] <= to:
            arrived.append(self._out.popleft())
        return arrived

    # -- the course of events -------------------------------------------------------------------------------

    def _next(self) -> float:
        """The next moment at which anything changes on the wire or in a node."""
        due = self.simulator.due()
        moment = inf if due is None else due
        if self._wire is not None:
            return min(moment, self._wire.end)
        waiting = [*(at for at, _ in list(self._host)[:1]), *(at for at, _, _ in self._coming[:1])]
        if self._ready:
            return min(moment, self._free_at)
        return min([moment, *(max(at, self._free_at) for at in waiting)])

    def _happen(self, moment: float) -> None:
        if self._wire is not None and self._wire.end <= moment:
            self._arrive(self._wire)
        for when, data in self.simulator.advance(moment):
            if isinstance(data, CanFrame):
                self._take(when, data)
        while self._coming and self._coming[0][0] <= moment:
            _, number, frame = heappop(self._coming)
            heappush(self._ready, _Pending(precedence(frame), number, frame))
        if self._wire is None and self._free_at <= moment:
            self._begin(moment)

    def _take(self, when: float, frame: CanFrame) -> None:
        """A node is ready to send; a report of a bus error is the adapter's own and needs no wire."""
        self._number += 1
        if frame.id & ERROR_FLAG:
            self._out.append((when + self.latency, frame))
        else:
            heappush(self._coming, (when, self._number, frame))

    def _begin(self, moment: float) -> None:
        """The wire is idle: of all that is ready, the frame of the lowest identifier begins."""
        host = self._host[0][1] if self._host and self._host[0][0] <= moment else None
        by_host = host is not None and (not self._ready or precedence(host) < self._ready[0].precedence)
        if by_host:
            frame = self._host.popleft()[1]
        elif self._ready:
            frame = heappop(self._ready).frame
        else:
            return
        time = bits(frame) / self.rate
        self._wire = _OnWire(frame, moment + time - INTERFRAME / self.rate, by_host)
        self._free_at = moment + time
        self.busy += time
        self.carried += 1

    def _arrive(self, sent: _OnWire) -> None:
        """A frame has passed: the nodes have heard the adapter, or the adapter has heard a node."""
        self._wire = None
        if sent.by_host:
            self.simulator.receive(sent.frame, sent.end)
        else:
            self._out.append((sent.end + self.latency, sent.frame))
