"""The course of events between the clients of a simulated bus and its devices, on a real clock.

It knows no ports: what clients send comes in, what they get goes out, each with its moment. Two ways of time: with
`pace` everything takes its time on the wire, which carries one thing at a time. Without it the wire is infinitely
fast: air time and return delays, all that is over within a few milliseconds, are not waited for; what takes longer
(an EEPROM write, a restart) is.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_bits import bits
from motorbus.core.family import Simulator
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Line, PerfectLine, Side

HASTE: Final = 0.004
"""Without pace, what a device would do within so many seconds it does at once."""
BACKLOG: Final = 1024
"""So many things under way, and clients are no longer listened to until some have arrived."""
_BITS_PER_BYTE = 10


class Event(NamedTuple):
    """Data that reaches one side at a moment; `order` keeps equal moments in the order they came about.

    `sender` is the client who sent it, None for a device or an echo; `rate` that of the client (bit/s), None when it
    has set none.
    """

    at: float
    order: int
    to: Side
    data: Data
    sender: object = None
    rate: int | None = None


class Course:
    """What is under way on one simulated bus.

    `pace`  bit/s at which data take their time, until the bus is tuned to another rate; None: no waiting
    `rate`  bit/s that the bus was tuned to last; None: never
    """

    def __init__(self, simulator: Simulator, *, line: Line | None = None, pace: int | None = None) -> None:
        if pace is not None and pace <= 0:
            raise RequestError(f"pace {pace} is not a rate", expected="bit/s, more than 0")
        self.simulator = simulator
        self.line: Line = line or PerfectLine()
        self.pace = pace
        self.rate: int | None = None
        self._events: list[Event] = []
        self._order = count()
        self._free_at = -inf

    @property
    def crowded(self) -> bool:
        """So much is under way that clients have to wait."""
        return len(self._events) >= BACKLOG

    def tune(self, rate: int | None) -> None:
        """Devices set to another rate (bit/s) neither hear nor are heard from now on; None changes nothing."""
        if rate is not None and rate != self.rate:
            self.rate = rate
            self.simulator.tune(rate)

    def forget(self) -> None:
        """What is under way never arrives."""
        self._events.clear()

    def hear(self, data: Data, now: float, sender: object = None, rate: int | None = None) -> None:
        """A client has sent this, at this rate (bit/s) if it has set one."""
        at = self._passed(data, now)
        for delivery in self.line.carry(Side.HOST, data, at):
            to_device = delivery.to is Side.DEVICE  # the client hears an echo as others do
            self._push(delivery, *((sender, rate) if to_device else (None, None)))

    def next(self) -> float:
        """The next moment at which something happens by itself."""
        due = self.simulator.due()
        spoken = inf if due is None else due if self.pace else due - HASTE
        return min(spoken, self._events[0].at) if self._events else spoken

    def happen(self, now: float) -> Iterator[Event]:
        """Everything up to this moment, in order; gives what clients get of it.

        A frame that reaches the devices reaches the other clients as well: on CAN everyone hears everyone.
        """
        while self.next() <= now:
            if self._events and self._events[0].at <= now:
                event = heappop(self._events)
                if event.to is Side.DEVICE:
                    self.tune(event.rate)
                    self.simulator.receive(event.data, event.at)
                if event.to is Side.HOST or isinstance(event.data, CanFrame):
                    yield event
            else:
                self._speak(now)
        self.simulator.advance(now)

    def _speak(self, now: float) -> None:
        """The devices begin to send what is due next."""
        due = self.simulator.due()
        for when, data in self.simulator.advance(now if due is None else due):
            at = self._passed(data, when) if self.pace else now
            for delivery in self.line.carry(Side.DEVICE, data, at):
                self._push(delivery)

    def _passed(self, data: Data, at: float) -> float:
        """When the end of this has passed the wire, which carries one thing at a time."""
        if not self.pace:
            return at
        length = bits(data) if isinstance(data, CanFrame) else len(data) * _BITS_PER_BYTE
        self._free_at = max(at, self._free_at) + length / (self.rate or self.pace)
        return self._free_at

    def _push(self, delivery: Delivery, sender: object = None, rate: int | None = None) -> None:
        heappush(
            self._events, Event(delivery.at, next(self._order), delivery.to, delivery.data, sender, rate)
        )
