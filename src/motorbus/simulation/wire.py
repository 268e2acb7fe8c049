"""Data under way between the programs on a simulated bus and its devices, on the clock of the caller.

With `pace` data takes its air time and one thing at a time is on the wire. Without it, what devices do within 4 ms
happens at once; longer operations (an EEPROM write, a restart) take their time.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import Audience, CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Side
from motorbus.simulation.faulty import FaultyBus

HASTE: Final = 0.004
"""Without pace, devices do at once what is due within so many seconds."""
PIECE: Final = 256
"""With pace, devices receive longer data in pieces of so many bytes, each when its last byte has passed."""
MAX_UNDER_WAY: Final = 1024
"""Items under way; beyond it programs wait."""
BITS_PER_BYTE: Final = 10


class Arrival(NamedTuple):
    """Data that arrives; `sender` is the program that sent it, None for a device or an echo."""

    at: float
    order: int
    to: Side
    data: Data
    sender: object


class Wire:
    """The wire of a simulated bus; `bus` is at both its ends.

    `rate`    bit/s of the host; `tune` sets it
    `pace`    whether data takes its air time
    `shared`  devices of others are on the bus: frames that are not for these devices do not reach them or faults
    """

    def __init__(self, bus: FaultyBus, *, rate: int, pace: bool = False, shared: bool = False) -> None:
        self.bus = bus
        self.rate = rate
        self.pace = pace
        self.shared = shared
        self._under_way: list[Arrival] = []
        self._order = count()
        self._free_at = -inf
        bus.tune(rate)

    def tune(self, rate: int) -> None:
        """Set the rate (bit/s) of the host; devices with another rate neither receive nor are received."""
        if rate != self.rate:
            self.rate = rate
            self.bus.tune(rate)

    @property
    def full(self) -> bool:
        """Whether programs must wait until data has arrived."""
        return len(self._under_way) >= MAX_UNDER_WAY

    def clear(self) -> None:
        """Drop all data under way."""
        self._under_way.clear()

    def send(self, data: Data, now: float, sender: object = None) -> None:
        """Send data of a program at this moment (s)."""
        for piece in self._cut(data):
            self._carry(Side.HOST, piece, self._passed(piece, now), sender)

    def due(self) -> float:
        """The moment (s) of the next event; inf without one."""
        arrival = self._under_way[0].at if self._under_way else inf
        due = self.bus.due()
        return arrival if due is None else min(arrival, due if self.pace else due - HASTE)

    def run(self, now: float) -> Iterator[Arrival]:
        """Let all happen up to this moment (s); yield what programs receive.

        On CAN every program receives the frames of the others.
        """
        haste = 0.0 if self.pace else HASTE
        while True:
            due = self.bus.due()
            moment = inf if due is None else due
            if self._under_way and self._under_way[0].at <= now and self._under_way[0].at < moment:
                arrival = heappop(self._under_way)
                if arrival.to is Side.DEVICE:
                    self.bus.receive(arrival.data, arrival.at)
                if arrival.to is Side.HOST or isinstance(arrival.data, CanFrame):
                    yield arrival
            elif moment - haste <= now:
                for at, data in self.bus.advance(moment):
                    self._carry(Side.DEVICE, data, self._passed(data, at) if self.pace else now)
            else:
                break
        self.bus.advance(now)

    def _carry(self, sender: Side, data: Data, at: float, program: object = None) -> None:
        """Put data on the line, which may lose, change or delay it."""
        if sender is Side.HOST and self._audience(data) is not Audience.OURS:
            if self._audience(data) is Audience.EVERYONE:
                self._push(Arrival(at, next(self._order), Side.DEVICE, data, program))
            else:
                self._push(Arrival(at, next(self._order), Side.HOST, data, program))
            return
        for arrival, to, received in self.bus.carry(sender, data, at):
            source = program if to is Side.DEVICE else None
            self._push(Arrival(arrival, next(self._order), to, received, source))

    def _push(self, arrival: Arrival) -> None:
        heappush(self._under_way, arrival)

    def _audience(self, data: Data) -> Audience:
        """The receivers of a frame on a shared bus; elsewhere the devices of this one."""
        if not self.shared:
            return Audience.OURS
        found: Audience = self.bus.audience(data)
        return found

    def _cut(self, data: Data) -> list[Data]:
        if not self.pace or isinstance(data, CanFrame):
            return [data]
        return [data[start : start + PIECE] for start in range(0, len(data), PIECE)]

    def _passed(self, data: Data, at: float) -> float:
        """The moment (s) at which the end of these data has passed the wire."""
        if not self.pace:
            return at
        size = bits(data) if isinstance(data, CanFrame) else len(data) * BITS_PER_BYTE
        self._free_at = max(at, self._free_at) + size / self.rate
        return self._free_at
