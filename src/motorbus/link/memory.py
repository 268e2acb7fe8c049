"""A link to a simulator in this process.

In virtual time the link never sleeps: its clock moves only inside `read`, from one event to the next, and the same
seed gives the same bytes. On the real clock it waits.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from heapq import heappop, heappush
from math import inf
from threading import Condition, get_ident

from motorbus.core.can_bits import bits
from motorbus.core.family import Simulator
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.link.base import Line, PerfectLine, Side

BITS_PER_BYTE = 10  # with start and stop bits


class VirtualClock:
    """A clock that moves only while a link on it is read. It belongs to the thread that uses a link on it first."""

    def __init__(self, now: float = 0.0) -> None:
        self.now = now
        self.links: list[MemoryLink] = []
        self._thread: int | None = None

    def check_thread(self) -> None:
        """Raise RequestError in any thread but the first that called this."""
        me = get_ident()
        if self._thread is None:
            self._thread = me
        elif self._thread != me:
            raise RequestError(
                "a simulated bus in virtual time is used by a second thread",
                cause="its time passes only while one thread waits",
                advice='simulate with clock="real", or use the bus in one thread',
            )


def share_clock(links: Iterable[MemoryLink]) -> None:
    """Put these links on one virtual clock, which shows the latest of their times."""
    found = list(links)
    clock = VirtualClock(max((link.now() for link in found), default=0.0))
    for link in found:
        link.advance(clock.now - link.now())
        link.clock = clock
    clock.links = found


class MemoryLink:
    """A `Link` to a simulator, for bytes or CAN frames.

    `rate`     bit/s, also of the simulator
    `line`     the wire between them
    `virtual`  time passes only inside `read`; False uses the monotonic clock
    `pace`     data takes its air time and queues behind earlier data: of its direction, or for CAN frames of the bus.
               A simulator with `paced` does this itself
    `start`    first moment (s) of the virtual clock
    """

    latency = 0.0
    simulated = True
    warnings: tuple[str, ...] = ()

    def __init__(
        self,
        simulator: Simulator,
        *,
        rate: int = 1_000_000,
        line: Line | None = None,
        virtual: bool = True,
        pace: bool = False,
        name: str = "memory",
        start: float = 0.0,
    ) -> None:
        self.simulator = simulator
        self.line: Line = line or PerfectLine()
        self.virtual = virtual
        self.pace = pace
        self.paced = pace or bool(getattr(simulator, "paced", False))
        self.name = name
        self.clock = VirtualClock(start)
        self._under_way: list[tuple[float, int, Side, Data]] = []
        self._arrived: list[Data] = []
        self._sequence = 0
        self._free = {Side.HOST: -inf, Side.DEVICE: -inf}
        self._gone_at = self._back_at = inf
        self._closed = False
        self._changed = Condition()
        self.tune(rate)

    def now(self) -> float:
        return self.clock.now if self.virtual else time.monotonic()

    def write(self, data: Data) -> None:
        with self._changed:
            now = self.now()
            self._check(now)
            if self.listen_only:
                raise LinkError(f"{self.name} only listens and cannot send")
            self._send(Side.HOST, data, now)
            self._changed.notify_all()

    def read(self, until: float) -> list[Data]:
        with self._changed:
            end = max(until, self.now())
            while not self._arrived:
                now = self.now()
                self._check(now)
                moment = self._next_event()
                if self.virtual:
                    moment = max(moment, now)
                if moment > now:
                    moment = min(moment, end)
                    if now >= end or not self._pass_time(moment):
                        break
                if moment <= self.now():
                    self._happen(moment)
            self._check(self.now())
            arrived, self._arrived = self._arrived, []
            return arrived

    def _pass_time(self, until: float) -> bool:
        """Wait until this moment (s), or for a change; False for a virtual clock when nothing will ever happen."""
        if not self.virtual:
            self._changed.wait(until - time.monotonic() if until < inf else None)
        elif until < inf:
            self._move_clock(until)
        return until < inf or not self.virtual

    def tune(self, rate: int, listen_only: bool = False) -> None:
        self.rate = rate
        self.listen_only = listen_only
        self.simulator.tune(rate)

    def fileno(self) -> int | None:
        return None

    def due(self) -> float:
        """Moment (s) of the next event if nothing is sent before; inf when there is none."""
        with self._changed:
            return -inf if self._arrived else self._next_event()

    def close(self) -> None:
        with self._changed:
            while self._under_way:  # a real port sends its buffer before it closes
                at, _, to, data = heappop(self._under_way)
                if to is Side.DEVICE and not self._closed and self.now() < self._gone_at:
                    self.simulator.receive(data, max(at, self.now()))
            self._closed = True
            self._changed.notify_all()

    def unplug(self, at: float = -inf, seconds: float = inf) -> None:
        """Unplug the adapter now or at a later moment (s), for so many seconds. Data under way is lost.

        The link raises LinkLost until it is renewed.
        """
        with self._changed:
            self._gone_at = at
            self._back_at = max(at, self.now()) + seconds
            self._changed.notify_all()

    def plug(self) -> None:
        """Plug the adapter in again; old data does not arrive any more."""
        with self._changed:
            now = self.now()
            if now >= self._gone_at:
                self._under_way.clear()
                self._arrived.clear()
                self.simulator.advance(now)  # drops what devices sent meanwhile
            self._gone_at = self._back_at = inf

    def renew(self, losses: int) -> None:
        with self._changed:
            if self._closed or self.now() < self._back_at:
                self._check(self.now())
            self.plug()

    def rest(self, until: float) -> None:
        with self._changed:
            now = self.now()
            moment = until if now >= self._back_at else min(until, self._back_at)
            if moment > now:
                self._pass_time(moment)

    def advance(self, seconds: float) -> None:
        """Let virtual time pass without reading; what arrives is kept for the next `read`."""
        with self._changed:
            end = self.clock.now + seconds
            self._happen_until(end)
            self._move_clock(end)

    def _move_clock(self, moment: float) -> None:
        """Let time pass on all links of the clock; what arrives on others is kept for their next `read`."""
        for link in self.clock.links:
            if link is not self:
                link._happen_until(moment)
        self.clock.now = moment

    def _check(self, now: float) -> None:
        if self._closed:
            raise LinkLost(f"{self.name}: the port is closed")
        if now >= self._gone_at:
            raise LinkLost(f"{self.name}: the simulated adapter was unplugged")

    def _next_event(self) -> float:
        if self.now() >= self._gone_at:
            return self._back_at
        due = self.simulator.due()
        moment = self._gone_at if due is None else min(due, self._gone_at)
        return min(moment, self._under_way[0][0]) if self._under_way else moment

    def _happen_until(self, end: float) -> None:
        while (moment := self._next_event()) <= end and moment < self._gone_at:
            self._happen(moment)
        if end < self._gone_at:
            self._happen(end)

    def _happen(self, moment: float) -> None:
        """Process all events of this moment: devices begin to send, and data under way arrives."""
        for when, data in self.simulator.advance(moment):
            self._send(Side.DEVICE, data, when)
        while self._under_way and self._under_way[0][0] <= moment:
            at, _, to, data = heappop(self._under_way)
            if to is Side.HOST:
                self._arrived.append(data)
            else:
                self.simulator.receive(data, at)

    def _send(self, sender: Side, data: Data, at: float) -> None:
        """Put data on the wire at this moment (s), or when the wire is free."""
        if self.pace:
            if isinstance(data, CanFrame):  # one wire for both directions
                wire, size = Side.HOST, bits(data)
            else:
                wire, size = sender, len(data) * BITS_PER_BYTE
            at = self._free[wire] = max(at, self._free[wire]) + size / self.rate
        for arrival, to, received in self.line.carry(sender, data, at):
            self._sequence += 1  # data of one moment arrives in the order in which it was sent
            heappush(self._under_way, (arrival, self._sequence, to, received))
