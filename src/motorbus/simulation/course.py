"""The course of events between the clients of a simulated bus and its devices, on a real clock.

It knows no ports: what clients send comes in, what they get goes out, each with its moment. Two ways of time: with
`pace` everything takes its time on the wire, which carries one thing at a time. Without it the wire is infinitely
fast: air time and return delays, all that is over within a few milliseconds, are not waited for; what takes longer
(an EEPROM write, a restart) is.

On a full line there is something to do at every moment, so with `pace` it is done where it holds nothing up: devices
hear a long piece packet by packet, not all of it at its end, and they work out what they will say while the last bytes
of the request are still on the wire.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import Audience, CanFrame
from motorbus.core.family import Simulator
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Line, PerfectLine, Side

HASTE: Final = 0.004
"""Without pace, what a device would do within so many seconds it does at once."""
BACKLOG: Final = 1024
"""So many things under way, and clients are no longer listened to until some have arrived."""
PIECE: Final = 256
"""Bytes that devices on a paced line hear at once, about a packet: each piece when its own last byte has passed."""
AHEAD: Final = 0.004
"""s by which devices on a paced line are given bytes early, with the moment at which the last of them has passed:
nothing can come between, for one thing at a time is on the wire."""
_BITS_PER_BYTE = 10


class Event(NamedTuple):
    """Data that reaches one side at a moment; `order` keeps equal moments in the order they came about.

    `sender` is the client who sent it, None for a device or an echo; `rate` that of the client (bit/s), None when it
    has set none. `alone`: the devices get it, and no client.
    """

    at: float
    order: int
    to: Side
    data: Data
    sender: object = None
    rate: int | None = None
    alone: bool = False


class Course:
    """What is under way on one simulated bus.

    `pace`  bit/s at which data take their time, until the bus is tuned to another rate; None: no waiting
    `rate`  bit/s that the bus was tuned to last; None: never
    `shared`  there are devices of others on it: what is not for these here passes as if there were no line, and of what
              is for everyone nobody else gets less, more or anything other than what was sent
    """

    def __init__(
        self, simulator: Simulator, *, line: Line | None = None, pace: int | None = None, shared: bool = False
    ) -> None:
        if pace is not None and pace <= 0:
            raise RequestError(f"pace {pace} is not a rate", expected="bit/s, more than 0")
        self.simulator = simulator
        self.line: Line = line or PerfectLine()
        self.pace = pace
        self.rate: int | None = None
        self._shared = shared
        self._events: list[Event] = []
        self._order = count()
        self._free_at = -inf
        self._heard_at = -inf

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
        audience = self._audience(data)
        if audience is Audience.NONE:
            self._push(Delivery(at, Side.DEVICE, data), sender, rate)
            return
        alone = audience is Audience.EVERYONE
        if alone:
            self._push(Delivery(at, Side.HOST, data), sender)
        for delivery in self._carried(data, at, alone):
            if delivery.to is Side.DEVICE:
                for piece in self._pieces(delivery):
                    self._push(piece, sender, rate, alone)
            elif not alone:  # the client hears an echo as others do
                self._push(delivery)

    def _carried(self, data: Data, at: float, alone: bool) -> list[Delivery]:
        """What becomes of it; a line that keeps books is told that nobody would hear an echo of it."""
        unechoed: Callable[[Data, float], list[Delivery]] | None = getattr(self.line, "carry_unechoed", None)
        return unechoed(data, at) if alone and unechoed else self.line.carry(Side.HOST, data, at)

    def _audience(self, data: Data) -> Audience:
        """Whom this is for. Where nobody else is, all of it is for these devices."""
        if not self._shared:
            return Audience.OURS
        told: Callable[[Data], Audience] | None = getattr(self.simulator, "audience", None)
        return told(data) if told else Audience.NONE

    def next(self) -> float:
        """The next moment at which something happens by itself."""
        spoken = self._speaks()
        return min(spoken, self._arrives(spoken))

    def happen(self, now: float) -> Iterator[Event]:
        """Everything up to this moment, in order; gives what clients get of it.

        A frame that reaches the devices reaches the other clients as well: on CAN everyone hears everyone.
        """
        while min(spoken := self._speaks(), arrives := self._arrives(spoken)) <= now:
            if arrives <= now:
                event = heappop(self._events)
                if event.to is Side.DEVICE:
                    self._heard_at = max(self._heard_at, event.at)
                    self.tune(event.rate)
                    self.simulator.receive(event.data, event.at)
                if event.to is Side.HOST or (isinstance(event.data, CanFrame) and not event.alone):
                    yield event
            else:
                self._speak(now)
        if now >= self._heard_at:
            self.simulator.advance(now)

    def _speaks(self) -> float:
        """When the devices are to be asked what they say."""
        due = self.simulator.due()
        return inf if due is None else due if self.pace else due - HASTE

    def _arrives(self, spoken: float) -> float:
        """When the first of what is under way is to be given to whom it reaches."""
        if not self._events:
            return inf
        first = self._events[0]
        plain = first.to is Side.DEVICE and not isinstance(first.data, CanFrame)
        return first.at - AHEAD if self.pace and plain and first.at < spoken else first.at

    def _pieces(self, delivery: Delivery) -> list[Delivery]:
        """The same in pieces, each with the moment at which its own last byte has passed."""
        end, to, data = delivery
        if not self.pace or isinstance(data, CanFrame) or len(data) <= PIECE:
            return [delivery]
        byte = _BITS_PER_BYTE / (self.rate or self.pace)
        cut = [data[begin : begin + PIECE] for begin in range(0, len(data), PIECE)]
        left = range(len(data) - PIECE, 0, -PIECE)
        return [
            Delivery(end - max(0, more) * byte, to, one) for one, more in zip(cut, [*left, 0], strict=True)
        ]

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

    def _push(
        self, delivery: Delivery, sender: object = None, rate: int | None = None, alone: bool = False
    ) -> None:
        at, to, data = delivery
        heappush(self._events, Event(at, next(self._order), to, data, sender, rate, alone))
