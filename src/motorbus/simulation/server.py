"""Serves a simulated bus on real ports in real time, so that any program can open it: one loop, one thread."""

from __future__ import annotations

import os
import selectors
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from math import inf
from typing import Final, Self, TypeAlias

from motorbus.core.family import Simulator
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.simulation.can_channel import CanChannel
from motorbus.simulation.clients import Client
from motorbus.simulation.faults import Script, parse
from motorbus.simulation.faulty import FaultyBus
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.slcan import SlcanAdapter
from motorbus.simulation.tcp import TcpPort
from motorbus.simulation.wire import Wire

MAX_WAIT: Final = 1.0  # s
RETRY: Final = 0.01
"""s after which a program that does not read, or a full wire, is tried again."""
SLICE: Final = 0.05
"""s of waiting for a channel without a descriptor before the other ports are looked at."""

Port: TypeAlias = PtyMaster | TcpPort | CanChannel


class Server:
    """A simulated bus on ports: one for a serial line, any number for a CAN bus.

    `slcan`   programs speak slcan, for devices on CAN
    `rate`    bit/s until a program sets one
    `pace`    data takes its air time
    `faults`  the bus with its faults; `set_faults` changes them
    `lock`    held while devices and programs are served; take it to use the devices in another thread

    The ports belong to the caller.
    """

    def __init__(
        self,
        simulator: Simulator,
        *ports: Port,
        rate: int,
        slcan: bool = False,
        pace: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.simulator = simulator
        self.clients: list[Client | CanChannel] = []
        self.lock = threading.RLock()
        self._ports = ports
        self._rate = rate
        self._slcan = slcan
        self._clock = clock
        can_unplug = all(port.can_unplug for port in ports)
        self.faults = FaultyBus(simulator, self._unplug if can_unplug else None)
        is_shared = any(isinstance(port, CanChannel) for port in ports)
        self.wire = Wire(self.faults, rate=rate, pace=pace, shared=is_shared)
        # select(2) waits to the microsecond; epoll and poll wait whole milliseconds
        self._selector = selectors.SelectSelector()
        self._wake, self._ring = os.pipe()
        self._stopped = False
        self._is_behind = False  # a program has not read all of its data
        self._unplug_for: float | None = None
        self._plug_at = inf
        self.watch(self._wake, lambda: None)
        for port in ports:
            self._attach(port)

    @property
    def lost(self) -> int:
        """Bytes, or CAN frames, that programs did not read in time."""
        return sum(client.lost for client in self.clients)

    def set_faults(self, script: Script | str) -> None:
        """Replace the faults; "" has none. Raises RequestError; the former faults stay then."""
        given = parse(script) if isinstance(script, str) else script
        for port in self._ports if given.faults else ():
            if isinstance(port, CanChannel) and port.has_wire:
                raise faults_on_wire(port.name)
        self.faults.set(given, self._clock())

    def serve(self) -> None:
        """Serve until `stop`."""
        while not self._stopped:
            self.step()

    def stop(self) -> None:
        """End `serve`; for signal handlers and other threads."""
        self._stopped = True
        os.write(self._ring, b".")

    def close(self) -> None:
        """Close the connections of programs; a second call does nothing."""
        if self._wake < 0:
            return
        for client in self.clients:
            client.close()
        self._selector.close()
        os.close(self._wake)
        os.close(self._ring)
        self._wake = -1

    def watch(self, descriptor: int, act: Callable[[], None]) -> None:
        """Call `act` whenever this descriptor is readable; replaces the former watch."""
        self.unwatch(descriptor)
        self._selector.register(descriptor, selectors.EVENT_READ, act)

    def unwatch(self, descriptor: int) -> None:
        """End the watch of this descriptor, if there is one."""
        if descriptor in (self._selector.get_map() or ()):  # None once the server is closed
            self._selector.unregister(descriptor)

    def step(self, timeout: float = MAX_WAIT) -> None:
        """Wait for the next event, at most so long (s), and carry it out."""
        wait = min(timeout, max(0.0, min(self.wire.due(), self._plug_at) - self._clock()))
        for client in self.clients:
            if isinstance(client, CanChannel) and client.fileno() is None:
                self._receive_polled(client, min(wait, SLICE))
                wait = 0.0
        ready = self._selector.select(min(wait, RETRY) if self._is_behind else wait)
        with self.lock:
            self._run()
            for key, _ in ready:
                if key.fd in self._selector.get_map():  # not closed by an earlier event
                    key.data()
            if ready:
                self._run()
            self._drop_gone()

    def _run(self) -> None:
        """Carry out all events up to now."""
        now = self._clock()
        for arrival in self.wire.run(now):
            for client in self.clients if self._unplug_for is None else ():
                if client is not arrival.sender:
                    client.send(arrival.data, min(arrival.at, now))
        self._is_behind = False
        for client in self.clients:
            self._is_behind |= not client.flush()
        if self._unplug_for is not None:
            self._detach(now + self._unplug_for)
        elif self._plug_at <= now:
            self._plug_at = inf
            for port in self._ports:
                if not isinstance(port, CanChannel):
                    port.plug()
                self._attach(port)
            self.wire.tune(self._rate)

    # -- programs ------------------------------------------------------------------------------------------------

    def _attach(self, port: Port) -> None:
        """Let programs come by this port."""
        if isinstance(port, TcpPort):
            self.watch(port.fileno(), partial(self._accept, port))
        elif isinstance(port, PtyMaster):
            if not self._slcan:
                port.set_rate(self._rate)
            self._add(Client(port, SlcanAdapter() if self._slcan else None))
        else:
            self._add(port)

    def _accept(self, port: TcpPort) -> None:
        stream = port.accept()
        if stream is None:
            return
        if not self._slcan:
            self.unwatch(port.fileno())  # a serial line has one program; the next one waits
        self._add(Client(stream, SlcanAdapter() if self._slcan else None))

    def _add(self, client: Client | CanChannel) -> None:
        self.clients.append(client)
        descriptor = client.fileno()
        if descriptor is not None:
            self.watch(descriptor, partial(self._receive, client))

    def _receive(self, client: Client | CanChannel) -> None:
        if self.wire.full:
            time.sleep(RETRY)
            return
        self._send(client, client.receive())

    def _receive_polled(self, client: CanChannel, wait: float) -> None:
        found = client.receive(wait)
        with self.lock:
            self._send(client, found)
            self._run()

    def _send(self, client: Client | CanChannel, found: list[Data]) -> None:
        rates = [client.rate(), *(one.rate() for one in self.clients)]
        self.wire.tune(next((rate for rate in rates if rate is not None), self._rate))
        now = self._clock()  # frames that a program sends at once compete for the bus
        for data in found:
            self.wire.send(data, now, client)

    def _drop_gone(self) -> None:
        for client in [one for one in self.clients if one.gone]:
            self._unwatch(client)
            self.clients.remove(client)
            client.close()
            for port in self._ports:
                if isinstance(port, TcpPort):
                    self._attach(port)

    def _unwatch(self, client: Client | CanChannel) -> None:
        descriptor = client.fileno()
        if descriptor is not None:
            self.unwatch(descriptor)

    # -- the ports -----------------------------------------------------------------------------------------------

    def _unplug(self, seconds: float) -> None:
        """Unplug all ports for so long (s), after the present event."""
        self._unplug_for = seconds
        self.wire.clear()

    def _detach(self, until: float) -> None:
        """Close all ports until this moment (s)."""
        for client in self.clients:
            self._unwatch(client)
        for port in self._ports:
            if isinstance(port, TcpPort):
                self.unwatch(port.fileno())
            if not isinstance(port, CanChannel):
                port.unplug()  # before its programs, which would come back at once
        for client in self.clients:
            client.close()
        self.clients.clear()
        self._unplug_for, self._plug_at = None, until


def faults_on_wire(port: str) -> RequestError:
    """The error for faults on a CAN channel that may have real devices."""
    return RequestError(
        f"{port}: faults are refused on a CAN bus that may have real devices; nothing was changed",
        expected="a bus of programs alone: can://virtual, can://udp_multicast, or can://socketcan/vcan0",
        cause="a fault would also strike frames of other devices",
        advice="serve the devices by --link or --tcp, or on can://socketcan/vcan0",
    )


class ServerThread:
    """A server at work in a thread until `close`; use it in a `with`. An error of the thread is raised by `close`."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="motorbus-simulation", daemon=True)
        self._thread.start()

    def now(self) -> float:
        """The moment (s) on the clock of the devices."""
        return self.server._clock()

    @contextmanager
    def still(self) -> Iterator[None]:
        """Stop the bus meanwhile, so that this thread may use the devices."""
        with self.server.lock:
            yield

    def close(self) -> None:
        """End the server and leave the bus; a second call does nothing."""
        if self._thread.is_alive():
            self.server.stop()
        self._thread.join()
        self.server.close()
        error, self._error = self._error, None
        if error is not None:
            raise error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _work(self) -> None:
        try:
            self.server.serve()
        except BaseException as error:
            self._error = error
