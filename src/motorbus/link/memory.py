"""A link to a simulator in this process.

In virtual time the link never sleeps: its clock moves only inside `read`, `rest` and `advance`, from one event to the
next, so a run with the same seeds of simulator and line gives the same bytes. With `virtual=False` it uses the
monotonic clock and waits.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from heapq import heappop, heappush
from math import inf
from threading import Condition, get_ident

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Simulator
from motorbus.core.request import Data
from motorbus.errors import LinkLost, RequestError
from motorbus.link.base import Line, PerfectLine, Side

BITS_PER_BYTE = 10  # with start and stop bits


class VirtualClock:
    """A clock that only its links move. It belongs to the thread that first calls `check_thread`, as a bus does."""

    def __init__(self, now: float = 0.0) -> None:
        self.now = now
        self.links: list[MemoryLink] = []
        self._thread: int | None = None

    def check_thread(self) -> None:
        """Make the thread of the first caller the owner; raise RequestError in any other."""
        me = get_ident()
        if self._thread is None:
            self._thread = me
        elif self._thread != me:
            raise RequestError(
                "a simulated bus in virtual time is used by a second thread",
                cause="virtual time moves only while its thread waits, so two threads cannot share it",
                advice='simulate with clock="real", or use the bus in one thread',
            )


def share_clock(links: Iterable[MemoryLink]) -> None:
    """Advance these links to the latest of their times and put them on one clock."""
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
    `virtual`  time passes only inside `read`, `rest` and `advance`; False uses the monotonic clock
    `pace`     data takes its air time and waits until the wire is free. Bytes have one wire per direction, CAN frames
               share one. Not for a simulator that does this itself, which has an attribute `paced`
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
        self._condition = Condition()
        self.tune(rate)

    def now(self) -> float:
        return self.clock.now if self.virtual else time.monotonic()

    def write(self, data: Data) -> None:
        with self._condition:
            now = self.now()
            self._check(now)
            self._send(Side.HOST, data, now)
            self._condition.notify_all()

    def read(self, until: float) -> list[Data]:
        with self._condition:
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
                    self._process(moment)
            self._check(self.now())
            arrived, self._arrived = self._arrived, []
            return arrived

    def _pass_time(self, until: float) -> bool:
        """Wait until this moment (s) or a change. False: time is virtual and the moment is inf, nothing can happen."""
        if not self.virtual:
            self._condition.wait(until - time.monotonic() if until < inf else None)
        elif until < inf:
            self._move_clock(until)
        return until < inf or not self.virtual

    def tune(self, rate: int) -> None:
        self.rate = rate
        self.simulator.tune(rate)

    def fileno(self) -> int | None:
        return None

    def due(self) -> float:
        """Moment (s) of the next event if nothing is sent before; inf without one, -inf if data waits to be read."""
        with self._condition:
            return -inf if self._arrived else self._next_event()

    def close(self) -> None:
        with self._condition:
            while self._under_way:  # a real port sends its buffer before it closes
                at, _, to, data = heappop(self._under_way)
                if to is Side.DEVICE and not self._closed and self.now() < self._gone_at:
                    self.simulator.receive(data, max(at, self.now()))
            self._closed = True
            self._condition.notify_all()

    def unplug(self, at: float = -inf, seconds: float = inf) -> None:
        """Unplug the adapter at a moment (s; default: now) for so many seconds. Data under way is lost.

        The link raises LinkLost until it is renewed.
        """
        with self._condition:
            self._gone_at = at
            self._back_at = max(at, self.now()) + seconds
            self._condition.notify_all()

    def plug(self) -> None:
        """Plug the adapter in again, or cancel a planned unplug. Data in flight and unread is dropped."""
        with self._condition:
            now = self.now()
            if now >= self._gone_at:
                self._under_way.clear()
                self._arrived.clear()
                self.simulator.advance(now)  # drops what devices sent meanwhile
            self._gone_at = self._back_at = inf

    def renew(self, losses: int) -> None:
        with self._condition:
            if self._closed or self.now() < self._back_at:
                self._check(self.now())
            self.plug()

    def rest(self, until: float) -> None:
        with self._condition:
            now = self.now()
            moment = until if now >= self._back_at else min(until, self._back_at)
            if moment > now:
                self._pass_time(moment)

    def advance(self, seconds: float) -> None:
        """Let virtual time pass without reading; what arrives is kept for the next `read`."""
        with self._condition:
            end = self.clock.now + seconds
            self._process_until(end)
            self._move_clock(end)

    def _move_clock(self, moment: float) -> None:
        """Move the clock. Events of the other links up to then are processed; those of this link are the caller's."""
        for link in self.clock.links:
            if link is not self:
                link._process_until(moment)
        self.clock.now = moment

    def _check(self, now: float) -> None:
        if self._closed:
            raise LinkLost(f"{self.name}: the port is closed")
        if now >= self._gone_at:
            raise LinkLost(f"{self.name}: the simulated adapter was unplugged")

    def _next_event(self) -> float:
        """Moment (s) of the next arrival, device event or unplugging; while unplugged, of plugging in again."""
        if self.now() >= self._gone_at:
            return self._back_at
        due = self.simulator.due()
        moment = self._gone_at if due is None else min(due, self._gone_at)
        return min(moment, self._under_way[0][0]) if self._under_way else moment

    def _process_until(self, end: float) -> None:
        while (moment := self._next_event()) <= end and moment < self._gone_at:
            self._process(moment)
        if end < self._gone_at:
            self._process(end)

    def _process(self, moment: float) -> None:
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
