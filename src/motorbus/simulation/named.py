"""Simulated buses of this process, by name: `feetech:sim:NAME` is the address of one.

A name is valid in this process while the simulation is open. One host at a time has the bus, as with a real port; when
it closes, the next one finds the motors where they stood.
"""

from __future__ import annotations

import time
from itertools import count
from math import inf
from threading import Lock
from typing import Any, Final, Self

from motorbus.core.family import Family, Simulator
from motorbus.errors import PortBusy, PortNotFound, RequestError
from motorbus.link.base import Line, PerfectLine
from motorbus.link.memory import MemoryLink
from motorbus.simulation.can_channel import CanChannel
from motorbus.simulation.faults import Script, parse
from motorbus.simulation.faulty import FaultyBus
from motorbus.simulation.server import Server, ServerThread

OPEN_TIME: Final = 0.1
"""s of virtual time that an attempt to open takes while the port is unplugged; else it would never be back."""

_open: dict[tuple[str, str], Simulation] = {}
_numbers = count(1)
_lock = Lock()


class Simulation:
    """A simulated bus, used in a `with`: open it by its `url`, use its devices by `simulation[3]`.

    `simulator`  the simulated devices
    `url`        its address, valid in this process until `close`
    `clock`      "virtual": time passes only while a host waits; "real": it runs
    `pace`       data takes its air time; set it before a link is opened

    `faults` is a script, see `simulation.faults`; other options are those of the family. Raises RequestError for an
    unknown model or option, an impossible clock, a bad script, or a name that is taken.
    """

    def __init__(
        self,
        family: Family,
        ids: tuple[int, ...],
        *,
        model: str = "",
        clock: str = "virtual",
        name: str | None = None,
        faults: str = "",
        **options: object,
    ) -> None:
        if clock not in ("virtual", "real"):
            raise RequestError(f"clock {clock!r} is not possible", expected="virtual or real")
        self.family = family
        self.clock = clock
        self.pace = False
        settings = {option.name for option in family.link.settings}
        self.settings = {option: value for option, value in options.items() if option in settings}
        known = {option.name for option in family.simulator_options()}
        options = {key: value for key, value in options.items() if key in known or key not in settings}
        self.simulator: Simulator = family.simulator(ids, model, **options)
        self._faulty = FaultyBus(self.simulator, lambda seconds: self.unplug(seconds=seconds))
        self._devices: Simulator = self.simulator
        self._line: Line = PerfectLine()
        self._host: MemoryLink | ServerThread | None = None
        self._left_at = 0.0 if clock == "virtual" else time.monotonic()
        self._back_at = -inf
        self._mutex = Lock()
        if faults:
            self.faults = faults
        self.name = _register(self, name)

    def __repr__(self) -> str:
        return f"<Simulation {self.url}, ids {', '.join(map(str, self.simulator.nodes))}>"

    @property
    def url(self) -> str:
        """The address for `motorbus.open`, with the settings of the bus, and its rate if it is not the usual one."""
        settings = dict(self.settings)
        rate = getattr(self.simulator, "usual_rate", None)
        if rate and rate != self.family.link.rate:
            settings["baud" if self.family.link.kind == "bytes" else "bitrate"] = rate
        text = "".join(f",{name}={value}" for name, value in settings.items())
        return f"{self.family.name}:sim:{self.name}{text}"

    @property
    def line(self) -> Line:
        """The wire between host and devices; a program may set another one at any time."""
        return self._line

    @line.setter
    def line(self, line: Line) -> None:
        if isinstance(self._host, ServerThread):
            raise RequestError(f"{self.url} is served on a CAN channel, which has its own line")
        with self._mutex:
            self._line = line
            if self._host is not None:
                self._host.simulator, self._host.line = self._devices, line

    @property
    def faults(self) -> FaultyBus:
        """The faults and what happened; set a script to replace them from now on, "" for none.

        Raises RequestError for a bad script and for what is not possible here; the former faults stay then.
        """
        return self._host.server.faults if isinstance(self._host, ServerThread) else self._faulty

    @faults.setter
    def faults(self, script: str | Script) -> None:
        given = parse(script) if isinstance(script, str) else script
        if isinstance(self._host, ServerThread):
            with self._host.still():
                self._host.server.set_faults(given)
            return
        self._faulty.set(given, self.now)
        self._devices = self._faulty
        self.line = self._faulty

    def unplug(self, *, seconds: float) -> None:
        """Unplug the port: the host gets LinkLost, and for so long (s) none can open it."""
        if isinstance(self._host, ServerThread):
            raise RequestError(f"{self.url} is served on a channel that cannot be unplugged")
        self._back_at = self.now + seconds
        if self._host is not None:
            self._host.unplug(seconds=seconds)

    @property
    def now(self) -> float:
        """The moment (s) on the clock of the devices; a virtual clock begins at 0."""
        if self._host is not None:
            return self._host.now()
        return self._left_at if self.clock == "virtual" else time.monotonic()

    def wait(self, until: float) -> None:
        """Let time pass for the devices until this moment (s); no effect if it has passed.

        A virtual clock jumps there, so simulations that wait for the same moments have one clock.
        """
        seconds = until - self.now
        if seconds <= 0:
            return
        if self.clock == "real" or isinstance(self._host, ServerThread):
            time.sleep(seconds)
        elif self._host is not None:
            self._host.advance(seconds)
        else:
            self._left_at = until

    def __getitem__(self, node: int) -> Any:
        """The simulated device with this id, see `core.family.SimulatedNode`. Raises RequestError without one."""
        try:
            return self.simulator.nodes[node]
        except KeyError:
            known = ", ".join(map(str, self.simulator.nodes))
            raise RequestError(
                f"{self.url} has no device {node} (0x{node:02X})", expected=f"one of {known}"
            ) from None

    def link(self, rate: int | None = None) -> MemoryLink:
        """A link to this bus. Raises PortBusy while another host has it, PortNotFound after `close`."""
        with self._mutex, _lock:
            self._check_free()
            if self.now < self._back_at:
                if self.clock == "virtual":
                    self._left_at += OPEN_TIME
                raise PortNotFound(f"{self.url}: the simulated adapter is unplugged")
            self._host = link = _SimulationLink(self, rate or self.family.link.rate)
            return link

    def serve(self, port: str, rate: int | None = None, **options: object) -> ServerThread:
        """Serve the devices on a CAN channel in real time, in a thread, until the result is closed.

        `port` is as `can://virtual/NAME`, `rate` its bit rate, `options` are for its adapter. Raises RequestError for
        devices without CAN, for another port, and for faults on a channel that may have real devices; PortBusy while a
        host has the bus; LinkError.
        """
        if self.family.link.kind != "frames":
            raise RequestError(f"{self.family.name} devices do not speak CAN")
        with self._mutex, _lock:
            self._check_free()
            usual = self.family.link.rate
            channel = CanChannel(port, rate or 0, usual, **options)
            offset = self._left_at - time.monotonic() if self.clock == "virtual" else 0.0
            try:
                server = Server(
                    self.simulator,
                    channel,
                    rate=rate or usual,
                    slcan=True,
                    pace=self.pace,
                    clock=lambda: time.monotonic() + offset,
                )
                server.set_faults(self._faulty.script)
            except BaseException:
                channel.close()
                raise
            self._host = served = _SimulationThread(self, server)
            return served

    def close(self) -> None:
        """Release its name; an open link is lost. A second call does nothing."""
        with _lock:
            if _open.get((self.family.name, self.name)) is self:
                del _open[self.family.name, self.name]
        if self._host is not None:
            self._host.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _check_free(self) -> None:
        if _open.get((self.family.name, self.name)) is not self:
            raise _not_found(self.name, self.family.name)
        if self._host is not None:
            raise PortBusy(f"{self.url} is open already", advice="close the other bus first")

    def _release(self, host: MemoryLink | ServerThread) -> None:
        """The host has closed; the next one may open the bus."""
        with self._mutex:
            if self._host is host:
                self._left_at = host.now()
                self._host = None


def find(name: str, family: str) -> Simulation:
    """The open simulation of this name. Raises PortNotFound, which names those that are open."""
    with _lock:
        try:
            return _open[family, name]
        except KeyError:
            raise _not_found(name, family) from None


def _register(simulation: Simulation, name: str | None) -> str:
    family = simulation.family.name
    with _lock:
        if name is None:
            name = next(text for text in map(str, _numbers) if (family, text) not in _open)
        elif not name or set(name) & set(",:#") or name != name.strip():
            raise RequestError(
                f"{name!r} cannot be the name of a bus", expected="no comma, colon, hash or outer space"
            )
        elif (family, name) in _open:
            raise RequestError(
                f"{family}:sim:{name} exists already", advice="choose another name, or close it"
            )
        _open[family, name] = simulation
        return name


def _not_found(name: str, family: str) -> PortNotFound:
    names = ", ".join(sorted(f"{family}:sim:{other}" for kind, other in _open if kind == family))
    return PortNotFound(
        f"there is no simulated bus {family}:sim:{name} in this process",
        expected=f"one of {names}" if names else "",
        advice=f"make one by motorbus.simulate({family!r}, name={name!r}), or write {family}:sim,ids=1-6",
    )


class _SimulationLink(MemoryLink):
    """The link of the present host; when it closes, the bus is free at that moment."""

    def __init__(self, simulation: Simulation, rate: int) -> None:
        self._simulation = simulation
        is_virtual = simulation.clock == "virtual"
        super().__init__(
            simulation._devices,
            rate=rate,
            line=simulation.line,
            virtual=is_virtual,
            pace=simulation.pace,
            name=simulation.url,
            start=simulation._left_at if is_virtual else time.monotonic(),
        )

    def close(self) -> None:
        super().close()
        self._simulation._release(self)


class _SimulationThread(ServerThread):
    """A simulation that is served on a channel; when it closes, the bus is free."""

    def __init__(self, simulation: Simulation, server: Server) -> None:
        self._simulation = simulation
        super().__init__(server)

    def close(self) -> None:
        try:
            super().close()
        finally:
            self._simulation._release(self)
