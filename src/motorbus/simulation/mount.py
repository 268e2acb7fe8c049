"""Serves a simulated bus on real ports, on the real clock, so that any program can open it.

The loop waits for what clients send and for the next thing that happens by itself, in one `select`; it has no
threads. What happens when is the business of `course`, who the clients are that of `clients`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from select import select
from typing import Final, Protocol, TypeAlias

from motorbus.core.family import Simulator
from motorbus.errors import RequestError
from motorbus.link.base import Line
from motorbus.simulation.adapter import Adapter
from motorbus.simulation.clients import CanClient, Door, Endpoint, Participant, SerialClient
from motorbus.simulation.course import HASTE, Course
from motorbus.simulation.faults.struck import is_calm, on_a_wire

__all__ = ["HASTE", "Attendant", "Endpoint", "Mount", "Place"]

_LONGEST_WAIT = 1.0
_SLICE: Final = 0.05
"""s that a participant without a descriptor is waited for before the others are looked at."""

Place: TypeAlias = Endpoint | Participant | Door
"""Where clients come in: an `Endpoint` has one client, of bytes unless an adapter is given with it."""


class Attendant(Protocol):
    """Something else that is served in the same loop, such as a control socket."""

    def descriptors(self) -> list[int]:
        """What to wait on until it turns readable."""

    def stuck(self) -> list[int]:
        """What to wait on until it can be written to."""

    def attend(self, descriptor: int) -> None:
        """This one is ready."""


class Mount:
    """A simulator where clients can reach it.

    `places`      one endpoint for bytes; or any number of CAN clients, doors and other participants of one CAN bus
    `adapter`     what a single endpoint speaks when the simulator speaks CAN frames
    `line`        what lies between clients and devices, faults included; on a bus that others share they strike only
                  what is for these devices or comes from them
    `pace`        bit/s at which data take their time, unless a client sets another rate; None: no waiting
    `rate`        bit/s of the bus until a client sets one. On a serial line the client's own is followed then, and a
                  device set to another one stays silent; None: every device hears every client. On CAN the rate set
                  last counts while its client has the bus open, and None leaves the simulator's own
    `attendants`  what else is served
    `lost`        how many bytes, or CAN frames, found no room because a client does not read
    """

    def __init__(
        self,
        simulator: Simulator,
        *places: Place,
        adapter: Adapter | None = None,
        line: Line | None = None,
        pace: int | None = None,
        rate: int | None = None,
        clock: Callable[[], float] = time.monotonic,
        attendants: Sequence[Attendant] = (),
    ) -> None:
        if adapter is not None and len(places) != 1:
            raise RequestError("an adapter belongs to one endpoint", expected="a CanClient for each")
        self.simulator = simulator
        self.attendants = tuple(attendants)
        self._clock = clock
        self._usual = rate
        self._doors = [place for place in places if isinstance(place, Door)]
        self._fixed = [_participant(place, adapter, rate) for place in places if not isinstance(place, Door)]
        shared = any(place.shared for place in self._fixed)
        self.course = Course(simulator, pace=pace, shared=shared)
        if line is not None:
            self.line = line
        self._lost_before = 0
        self._pull: float | None = None
        self._back_at: float | None = None

    @property
    def line(self) -> Line:
        """What lies between clients and devices. Setting one that does harm raises RequestError where it is `real`."""
        return self.course.line

    @line.setter
    def line(self, line: Line) -> None:
        if self.real and not is_calm(line):
            raise on_a_wire(self.real)
        self.course.line = line

    @property
    def real(self) -> str:
        """The CAN bus among its places on which there may be real devices; "" when none is."""
        return next((place.real for place in self._fixed if place.real), "")

    @property
    def fixed(self) -> str:
        """Why its port cannot be pulled; "" when it can."""
        return next((place.fixed for place in self._ports if place.fixed), "")

    @property
    def _ports(self) -> list[Participant | Door]:
        return [*self._fixed, *self._doors]

    def unplug(self, *, seconds: float) -> None:
        """Pull every port: whoever has one open loses it, what is under way is lost; after `seconds` they are back."""
        self._pull = seconds
        self.course.forget()

    @property
    def clients(self) -> list[Participant]:
        """Whoever takes part now."""
        if self._back_at is not None:
            return []
        if not self._doors:
            return self._fixed
        return [*self._fixed, *(client for door in self._doors for client in door.clients)]

    @property
    def lost(self) -> int:
        """Bytes, or CAN frames, that found no room."""
        return self._lost_before + sum(client.lost for client in self.clients)

    def serve(self, stop: int) -> None:
        """Serve until this descriptor turns readable."""
        while not self.step(stop):
            pass

    def step(self, stop: int | None = None, timeout: float = _LONGEST_WAIT) -> bool:
        """Wait for the next thing to do, at most so long (s), and do it. True when `stop` has turned readable."""
        wait = min(timeout, max(0.0, self._next() - self._clock()))
        everyone = {client: client.fileno() for client in self.clients}
        heeded = {} if self.course.crowded else everyone
        readers = {one: client for client, one in heeded.items() if one is not None}
        attended = {one: attendant for attendant in self.attendants for one in attendant.descriptors()}
        doors = {door.fileno(): door for door in self._doors if self._back_at is None}
        for client, one in heeded.items():
            if one is None:
                self._hear(client, min(wait, _SLICE))
                wait = 0.0
        waiting = [*readers, *attended, *doors, *(() if stop is None else (stop,))]
        stuck = [one for client, one in everyone.items() if one is not None and client.is_stuck()]
        behind = {one: attendant for attendant in self.attendants for one in attendant.stuck()}
        ready, room, _ = select(waiting, [*stuck, *behind], (), wait)
        self._happen(self._clock())
        for descriptor in ready:
            if self._back_at is not None and descriptor not in attended:
                continue  # it was pulled just now
            if descriptor in readers:
                self._hear(readers[descriptor])
            elif descriptor in doors:
                doors[descriptor].admit()
            elif descriptor in attended:
                attended[descriptor].attend(descriptor)
        for descriptor in behind.keys() & set(room):
            behind[descriptor].attend(descriptor)
        if ready or room:
            self._happen(self._clock())
        self._sweep()
        return stop in ready

    def _hear(self, client: Participant, patience: float = 0.0) -> None:
        """This client has said something, or left."""
        heard = client.read(self._clock(), patience)
        now, rate = self._clock(), client.rate()
        self.course.tune(self._others_rate() if rate is None else rate)
        for data in heard:
            self.course.hear(data, now, client, rate)

    def _happen(self, now: float) -> None:
        """Everything up to this moment, in order; what a client gets of it leaves in one piece."""
        for event in self.course.happen(now):
            for client in self.clients if self._pull is None else ():
                if client is not event.sender:
                    client.tell(event.data, min(event.at, now))
        for client in self.clients:
            client.flush()
        if self._pull is not None:
            self._go_away(now + self._pull)
        elif self._back_at is not None and now >= self._back_at:
            self._come_back()

    def _next(self) -> float:
        """The next moment at which something happens by itself."""
        due = self.course.next()
        return due if self._back_at is None else min(due, self._back_at)

    def _go_away(self, until: float) -> None:
        if self._back_at is None:
            for place in self._ports:
                place.unplug()
        self._pull, self._back_at = None, until
        self.course.forget()

    def _come_back(self) -> None:
        self._back_at = None
        for place in self._ports:
            place.plug()
            if isinstance(place, SerialClient) and self._usual is not None:
                _preset(place.fileno(), self._usual)
        self.course.tune(self._others_rate())

    def _sweep(self) -> None:
        if not self._doors:
            return
        gone = [client for door in self._doors for client in door.sweep()]
        self._lost_before += sum(client.lost for client in gone)
        if gone:
            self.course.tune(self._others_rate())

    def _others_rate(self) -> int | None:
        """The rate that some client has set, else that of the bus."""
        rates = (client.rate() for client in self.clients)
        return next((rate for rate in rates if rate is not None), self._usual)


def _participant(place: Endpoint | Participant, adapter: Adapter | None, rate: int | None) -> Participant:
    if isinstance(place, Participant):
        return place
    if adapter is not None:
        return CanClient(place, adapter)
    if rate is not None:
        _preset(place.fileno(), rate)
    return SerialClient(place, follows=rate is not None)


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
