"""Serves a simulated bus on a real port, on the real clock, so that any program can open it.

The loop waits for the host's bytes and for the next thing that happens by itself, in one `select`; it has no
threads. Two ways of time: with `pace` every byte takes its time on the wire, and the half-duplex wire carries one
thing at a time. Without it the wire is infinitely fast: air time and return delays, all that is over within a few
milliseconds, are not waited for; what takes longer (an EEPROM write, a restart) is.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from itertools import count
from math import inf
from select import select
from typing import NamedTuple, Protocol

from motorbus.core.family import Simulator
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import RequestError
from motorbus.link.base import Line, PerfectLine, Side

HASTE = 0.004
"""Without pace, what a device would do within so many seconds it does at once."""
_BITS = 10
_LONGEST_WAIT = 1.0


class Endpoint(Protocol):
    """A port that clients open: `link.pty.PtyMaster` or `listener.TcpListener`. Nothing of it blocks."""

    def fileno(self) -> int:
        """Turns readable when there is something to `read`."""

    def read(self) -> bytes:
        """What clients have sent; b"" when nothing."""

    def write(self, data: bytes) -> int:
        """Send to the client; what has no room is lost."""

    def rate(self) -> int | None:
        """Bit/s that the client has set; None: unknown."""


class Attendant(Protocol):
    """Something else that is served in the same loop, such as a control socket."""

    def descriptors(self) -> list[int]:
        """What to wait on until it turns readable."""

    def attend(self, descriptor: int) -> None:
        """This one has turned readable."""


class Event(NamedTuple):
    """Data that reaches one side at a moment; `order` keeps equal moments in the order they came about."""

    at: float
    order: int
    to: Side
    data: Data


class Mount:
    """A simulator on an endpoint.

    `line`        what lies between, faults included
    `pace`        bit/s at which bytes take their time, unless the client's own rate is followed; None: no waiting
    `rate`        bit/s that a terminal begins with; the client's own is followed then, and a device set to another
                  one stays silent. None: every device hears every client
    `kind`        what the simulator speaks; only "bytes" yet, else RequestError
    `attendants`  what else is served
    `lost`        how many bytes found no room because the client does not read
    """

    def __init__(
        self,
        simulator: Simulator,
        endpoint: Endpoint,
        *,
        line: Line | None = None,
        pace: int | None = None,
        rate: int | None = None,
        clock: Callable[[], float] = time.monotonic,
        kind: str = "bytes",
        attendants: Sequence[Attendant] = (),
    ) -> None:
        if kind != "bytes":
            raise RequestError(
                "a simulated CAN bus cannot be served on a port yet",
                cause="it needs the slcan protocol, which comes with the KST family",
            )
        if pace is not None and pace <= 0:
            raise RequestError(f"pace {pace} is not a rate", expected="bit/s, more than 0")
        self.simulator = simulator
        self.endpoint = endpoint
        self.line: Line = line or PerfectLine()
        self.pace = pace
        self.attendants = tuple(attendants)
        self.lost = 0
        self._clock = clock
        self._follows = rate is not None
        self._rate: int | None = None
        self._events: list[Event] = []
        self._order = count()
        self._free_at = -inf
        if rate is not None:
            _preset(endpoint.fileno(), rate)

    def serve(self, stop: int) -> None:
        """Serve until this descriptor turns readable."""
        while not self.step(stop):
            pass

    def step(self, stop: int | None = None, timeout: float = _LONGEST_WAIT) -> bool:
        """Wait for the next thing to do, at most so long (s), and do it. True when `stop` has turned readable."""
        port = self.endpoint.fileno()
        attended = {one: attendant for attendant in self.attendants for one in attendant.descriptors()}
        waiting = [port, *attended, *(() if stop is None else (stop,))]
        wait = min(timeout, max(0.0, self._next() - self._clock()))
        ready, _, _ = select(waiting, (), (), wait)
        now = self._clock()
        self._happen(now)
        if port in ready:
            self._hear(self.endpoint.read(), now)
        for descriptor in ready:
            if descriptor in attended:
                attended[descriptor].attend(descriptor)
        self._happen(now)
        return stop in ready

    def _hear(self, data: bytes, now: float) -> None:
        """The host has sent this."""
        if not data:
            return
        rate = self.endpoint.rate() if self._follows else None
        if rate is not None and rate != self._rate:
            self._rate = rate
            self.simulator.tune(rate)
        self._carry(Side.HOST, data, self._passed(data, now) if self.pace else now)

    def _passed(self, data: bytes, at: float) -> float:
        """When the last byte of this has passed the wire, which carries one thing at a time."""
        self._free_at = max(at, self._free_at) + len(data) * _BITS / (self._rate or self.pace or 1)
        return self._free_at

    def _carry(self, sender: Side, data: Data, at: float) -> None:
        for delivery in self.line.carry(sender, data, at):
            heappush(self._events, Event(delivery.at, next(self._order), delivery.to, delivery.data))

    def _next(self) -> float:
        """The next moment at which something happens by itself."""
        due = self.simulator.due()
        spoken = inf if due is None else due if self.pace else due - HASTE
        return min(spoken, self._events[0].at) if self._events else spoken

    def _happen(self, now: float) -> None:
        """Everything up to this moment, in order; what the host gets of it leaves in one piece."""
        out = bytearray()
        while self._next() <= now:
            if self._events and self._events[0].at <= now:
                event = heappop(self._events)
                if event.to is Side.DEVICE:
                    self.simulator.receive(event.data, event.at)
                else:
                    out += _bytes(event.data)
            else:
                self._speak(now)
        self.simulator.advance(now)
        if out:
            self.lost += len(out) - self.endpoint.write(bytes(out))

    def _speak(self, now: float) -> None:
        """The devices begin to send what is due next."""
        due = self.simulator.due()
        for when, data in self.simulator.advance(now if due is None else due):
            self._carry(Side.DEVICE, data, self._passed(_bytes(data), when) if self.pace else now)


def _preset(descriptor: int, rate: int) -> None:
    """Set a terminal to this rate, so that a client which sets none is heard. A socket has none to set."""
    try:
        import termios
    except ImportError:
        return
    code = getattr(termios, f"B{rate}", None)
    if code is not None and os.isatty(descriptor):
        settings = termios.tcgetattr(descriptor)
        settings[4] = settings[5] = code
        termios.tcsetattr(descriptor, termios.TCSANOW, settings)


def _bytes(data: Data) -> bytes:
    if isinstance(data, CanFrame):
        raise RequestError("this simulator speaks CAN frames, which this port cannot carry")
    return data
