"""A link that ends in a simulator of this process, with a clock of its own.

In virtual time nothing ever sleeps: the clock moves only inside `read`, from one event to the next. So ten minutes
of garbage or a hundred thousand late replies are over in seconds, and the same seed gives the same bytes. The
same link runs on the real clock when a person wants to watch.
"""

from __future__ import annotations

import time
from heapq import heappop, heappush
from math import inf
from threading import Condition

from motorbus.core.can_bits import bits
from motorbus.core.family import Simulator
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import LinkError, LinkLost
from motorbus.link.base import Line, PerfectLine, Side

BACKLOG = 1 << 20  # requests nobody has read the answers of; more is a runaway writer


class MemoryLink:
    """A `Link` over a simulator, for bytes or CAN frames.

    `rate`           bit/s; the simulator is tuned to it
    `line`           what lies between: nothing, or faults
    `virtual`        time passes only inside `read`; False uses the monotonic clock and really waits
    `pace`           data need their air time: a request reaches the simulator, and a reply the host, when its last
                     byte has passed, each queued behind what was sent before it: in that direction, or for CAN
                     frames, whose wire all share, at all. A simulator that is `paced` does so by itself
    `bits_per_byte`  start and stop bits included
    `start`          what a virtual clock shows at first; for a simulator that has lived before
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
        bits_per_byte: int = 10,
        start: float = 0.0,
    ) -> None:
        self.simulator = simulator
        self.line: Line = line or PerfectLine()
        self.virtual = virtual
        self.pace = pace
        self.paced = pace or bool(getattr(simulator, "paced", False))
        self.name = name
        self.bits_per_byte = bits_per_byte
        self._now = start
        self._under_way: list[tuple[float, int, Side, Data]] = []
        self._arrived: list[Data] = []
        self._serial = 0
        self._free = {Side.HOST: -inf, Side.DEVICE: -inf}
        self._gone_at = self._back_at = inf
        self._closed = False
        self._changed = Condition()
        self.tune(rate)

    # -- what every link offers -----------------------------------------------------------------------------

    def now(self) -> float:
        return self._now if self.virtual else time.monotonic()

    def write(self, data: Data) -> None:
        with self._changed:
            now = self.now()
            self._check(now)
            if self.listen_only:
                raise LinkError(f"{self.name} only listens: nothing was sent")
            if len(self._under_way) >= BACKLOG:
                raise LinkError(f"{self.name}: {BACKLOG} requests are under way and nobody reads")
            self._send(Side.HOST, data, now)
            self._changed.notify_all()

    def read(self, until: float) -> list[Data]:
        with self._changed:
            return self._read_virtual(until) if self.virtual else self._read_real(until)

    def tune(self, rate: int, listen_only: bool = False) -> None:
        self.rate = rate
        self.listen_only = listen_only
        self.simulator.tune(rate)

    def fileno(self) -> int | None:
        return None

    def due(self) -> float:
        """The next moment (s) at which something happens here, if nothing is sent before; inf when nothing will."""
        with self._changed:
            return -inf if self._arrived else self._next()

    def close(self) -> None:
        with self._changed:
            while self._under_way:  # a real port sends what it was given before it closes
                at, _, to, data = heappop(self._under_way)
                if to is Side.DEVICE and not self._closed and self.now() < self._gone_at:
                    self.simulator.receive(data, max(at, self.now()))
            self._closed = True
            self._changed.notify_all()

    # -- for tests ------------------------------------------------------------------------------------------

    def unplug(self, at: float = -inf, seconds: float = inf) -> None:
        """Pull the adapter, at once or at a moment to come: what is under way then is lost, `LinkLost` is raised.

        So many `seconds` later it is there again, and works as soon as it has been opened anew (`renew`).
        """
        with self._changed:
            self._gone_at = at
            self._back_at = max(at, self.now()) + seconds
            self._changed.notify_all()

    def plug(self) -> None:
        """Put the adapter back; what was under way when it was pulled does not come any more."""
        with self._changed:
            now = self.now()
            if now >= self._gone_at:
                self._under_way.clear()
                self._arrived.clear()
                self.simulator.advance(now)  # what devices have said meanwhile nobody has heard
            self._gone_at = self._back_at = inf

    def renew(self, losses: int) -> None:
        with self._changed:
            if self._closed or self.now() < self._back_at:
                self._check(self.now())
            self.plug()

    def rest(self, until: float) -> None:
        with self._changed:
            moment = until if self.now() >= self._back_at else min(until, self._back_at)
            if self.virtual:
                self._now = max(self._now, moment)
            elif moment > self.now():
                self._changed.wait(moment - self.now())

    def advance(self, seconds: float) -> None:
        """Let virtual time pass without reading; what arrives meanwhile is kept for the next `read`."""
        with self._changed:
            end = self._now + seconds
            self._happen_until(end)
            self._now = end

    @property
    def quiet(self) -> bool:
        """Nothing is under way, nothing waits to be read, and the adapter is there and stays."""
        return not (self._under_way or self._arrived) and self._gone_at == inf

    def inject(self, data: Data, seconds: float = 0.0) -> None:
        """Deliver data of a foreign sender to the host so many seconds later."""
        with self._changed:
            self._serial += 1
            heappush(self._under_way, (self.now() + seconds, self._serial, Side.HOST, data))
            self._changed.notify_all()

    # -- the course of events -------------------------------------------------------------------------------

    def _read_virtual(self, until: float) -> list[Data]:
        limit = max(until, self._now)
        while not self._arrived:
            self._check(self._now)
            moment = max(self._next(), self._now)
            if moment > limit:
                break
            self._now = moment
            self._happen(moment)
        self._check(self._now)
        if not self._arrived and self._now < limit < inf:
            self._now = limit
            self._happen(limit)
        return self._taken()

    def _read_real(self, until: float) -> list[Data]:
        while True:
            now = time.monotonic()
            self._check(now)
            self._happen_until(now)
            if self._arrived or now >= until:
                return self._taken()
            pause = min(self._next(), until) - now
            self._changed.wait(pause if pause < inf else None)

    def _taken(self) -> list[Data]:
        arrived, self._arrived = self._arrived, []
        return arrived

    def _check(self, now: float) -> None:
        if self._closed:
            raise LinkLost(f"{self.name}: the port is closed")
        if now >= self._gone_at:
            raise LinkLost(
                f"{self.name}: the adapter was unplugged", cause="the simulated adapter was pulled"
            )

    def _next(self) -> float:
        """The next moment that matters."""
        if self.now() >= self._gone_at:
            return self._back_at
        due = self.simulator.due()
        moment = self._gone_at if due is None else min(due, self._gone_at)
        return min(moment, self._under_way[0][0]) if self._under_way else moment

    def _happen_until(self, end: float) -> None:
        while (moment := self._next()) <= end and moment < self._gone_at:
            self._happen(moment)
        if end < self._gone_at:
            self._happen(end)

    def _happen(self, moment: float) -> None:
        """Everything of this moment: devices begin to send, and what is under way arrives."""
        begun = self.simulator.advance(moment)
        if begun and self._arrive_at_once(begun[-1][0], moment):
            self._arrived += [data for _, data in begun]
            return
        for when, data in begun:
            self._send(Side.DEVICE, data, when)
        while self._under_way and self._under_way[0][0] <= moment:
            at, _, to, data = heappop(self._under_way)
            if to is Side.HOST:
                self._arrived.append(data)
            else:
                self.simulator.receive(data, at)

    def _arrive_at_once(self, last: float, moment: float) -> bool:
        """Whether all that begins up to `last` is there by this moment, and nothing else is: a wire without faults and
        without pace is most of what a fleet has."""
        others = self._under_way[0][0] if self._under_way else inf
        return type(self.line) is PerfectLine and not self.pace and last <= moment < others

    def _send(self, sender: Side, data: Data, at: float) -> None:
        if self.pace:
            wire = Side.HOST if isinstance(data, CanFrame) else sender
            at = self._free[wire] = max(at, self._free[wire]) + self._air_time(data)
        for delivery in self.line.carry(sender, data, at):
            self._serial += 1  # equal moments arrive in the order they were sent
            heappush(self._under_way, (delivery.at, self._serial, delivery.to, delivery.data))

    def _air_time(self, data: Data) -> float:
        if isinstance(data, CanFrame):
            return bits(data) / self.rate
        return len(data) * self.bits_per_byte / self.rate
