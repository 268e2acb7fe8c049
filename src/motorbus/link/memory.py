"""A link that ends in a simulator of this process, with a clock of its own.

In virtual time nothing ever sleeps: the clock moves only inside `read`, from one event to the next. So ten minutes
of garbage or a hundred thousand late replies are over in seconds, and the same seed gives the same bytes. The
same link runs on the real clock when a person wants to watch.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from heapq import heappop, heappush
from math import inf
from random import Random
from threading import Condition
from typing import NamedTuple

from motorbus.core.can_bits import bits
from motorbus.core.family import Simulator
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import LinkError, LinkLost
from motorbus.link.base import Delivery, Line, PerfectLine, Side

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


class Fired(NamedTuple):
    """A fault that happened: when (s), which (the option's name), toward whom, and what was to be delivered."""

    at: float
    fault: str
    to: Side
    data: Data


class NoisyLine:
    """A wire with faults by chance: the same seed and the same traffic give the same bytes at the same moments.

    Probabilities count per packet (what one end sends at once) and lie in 0 … 1:

    `loss` `duplicate`    the whole packet is lost, or comes twice
    `corrupt`             one byte is another one
    `lose_byte` `insert_byte` `double_byte`   one byte is missing, too many, or there twice (not in CAN frames)
    `late`                it comes late by something within `late_by` (s), and so does all that follows it, because
                          devices and adapters are first-in first-out; with `overtake` the rest passes it by

    `delay`   every packet comes up to this many seconds later, order kept
    `echo`    the host hears itself; its echo suffers the same faults; may be switched at any time
    `split`   bytes come in random pieces, up to `gap` seconds apart
    `toward`  faults strike only what goes to this side; None strikes both

    `fired` lists every fault in the order they happened, so that a test can assert that its fault did.
    """

    def __init__(
        self,
        seed: int,
        *,
        delay: float = 0.0,
        loss: float = 0.0,
        duplicate: float = 0.0,
        corrupt: float = 0.0,
        lose_byte: float = 0.0,
        insert_byte: float = 0.0,
        double_byte: float = 0.0,
        late: float = 0.0,
        late_by: tuple[float, float] = (0.02, 0.5),
        overtake: bool = False,
        echo: bool = False,
        split: bool = False,
        gap: float = 0.0002,
        toward: Side | None = Side.HOST,
    ) -> None:
        self.delay = delay
        self.loss = loss
        self.duplicate = duplicate
        self.late = late
        self.late_by = late_by
        self.overtake = overtake
        self.echo = echo
        self.split = split
        self.gap = gap
        self.toward = toward
        self.fired: list[Fired] = []
        self._byte_faults = {
            "corrupt": corrupt,
            "lose_byte": lose_byte,
            "insert_byte": insert_byte,
            "double_byte": double_byte,
        }
        self._random = Random(seed)
        self._last = {Side.HOST: -inf, Side.DEVICE: -inf}

    def count(self, fault: str) -> int:
        """How often this fault has happened."""
        return sum(fired.fault == fault for fired in self.fired)

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        other = Side.DEVICE if sender is Side.HOST else Side.HOST
        deliveries = list(self._toward(other, data, at))
        if self.echo and sender is Side.HOST:
            self.fired.append(Fired(at, "echo", Side.HOST, data))
            deliveries += self._toward(Side.HOST, data, at)
        return deliveries

    def _toward(self, to: Side, data: Data, at: float) -> Iterator[Delivery]:
        if self.toward not in (None, to):
            yield Delivery(at, to, data)
        elif not self._strikes("loss", self.loss, to, data, at):
            yield from self._pieces(to, data, at)
            if self._strikes("duplicate", self.duplicate, to, data, at):
                yield from self._pieces(to, data, at)

    def _pieces(self, to: Side, data: Data, at: float) -> Iterator[Delivery]:
        is_late = self._strikes("late", self.late, to, data, at)
        if is_late:
            moment = max(at + self._random.uniform(*self.late_by), self._last[to])
        else:
            moment = max(at + self._random.uniform(0.0, self.delay), self._last[to])
            if moment > at:
                self.fired.append(Fired(at, "delay", to, data))
        for piece in self._cut(to, self._damaged(to, data, at), at):
            yield Delivery(moment, to, piece)
            if not (is_late and self.overtake):
                self._last[to] = moment
            moment += self._random.uniform(0.0, self.gap) if self.split else 0.0

    def _strikes(self, fault: str, probability: float, to: Side, data: Data, at: float) -> bool:
        if not probability or self._random.random() >= probability:
            return False
        self.fired.append(Fired(at, fault, to, data))
        return True

    def _damaged(self, to: Side, data: Data, at: float) -> Data:
        for fault, probability in self._byte_faults.items():
            if isinstance(data, CanFrame):
                if fault == "corrupt" and data.data and self._strikes(fault, probability, to, data, at):
                    data = data._replace(data=self._struck(fault, data.data))
            elif data and self._strikes(fault, probability, to, data, at):
                data = self._struck(fault, data)
        return data

    def _struck(self, fault: str, data: bytes) -> bytes:
        spot = self._random.randrange(len(data))
        if fault == "insert_byte":
            return data[:spot] + self._random.randbytes(1) + data[spot:]
        struck = {
            "corrupt": bytes([data[spot] ^ self._random.randrange(1, 256)]),
            "lose_byte": b"",
            "double_byte": data[spot : spot + 1] * 2,
        }[fault]
        return data[:spot] + struck + data[spot + 1 :]

    def _cut(self, to: Side, data: Data, at: float) -> list[Data]:
        if isinstance(data, CanFrame):
            return [data]
        if not self.split or len(data) < 2:
            return [data] if data else []
        cuts = sorted(self._random.sample(range(1, len(data)), self._random.randrange(len(data))))
        if cuts:
            self.fired.append(Fired(at, "split", to, data))
        return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]
