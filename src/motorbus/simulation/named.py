"""Simulated buses of this process, by name, so that an address can lead to one: `feetech:sim:NAME`.

A name is worth something in this process only, and only while the simulation is open. One host at a time has the
bus, as with a real port; when it closes its link another may open one, and the motors stand where they stood.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import nullcontext
from itertools import count
from math import inf
from threading import Lock
from types import TracebackType
from typing import Any, Final, Self, TypeAlias

from motorbus.core.family import Family, Simulator
from motorbus.errors import PortBusy, PortNotFound, RequestError
from motorbus.link.base import Line, PerfectLine
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults import Fault, FaultyLine, Script, World
from motorbus.simulation.faults.script import requested
from motorbus.simulation.faults.struck import is_calm, on_a_wire
from motorbus.simulation.served import LinkClient, Served, check_harmless, join
from motorbus.simulation.told import told

Faults: TypeAlias = str | Script | Iterable[Fault]
KNOCK: Final = 0.1
"""s of virtual time that an attempt to open takes while the port is away; else it would never come back."""

_live: dict[tuple[str, str], Simulation] = {}
_numbers = count(1)
_lock = Lock()


class Simulation:
    """A simulated bus, used in a `with`: open it by its `url`, poke its nodes by `simulation[3]`.

    `simulator`  the simulated bus itself
    `url`        its address, valid in this process until `close`
    `clock`      "virtual": time passes only while a host waits; "real": it runs
    `pace`       set it before a link is opened and bytes take their time on the wire
    `faults`     a script of what goes wrong, see `motorbus.simulation.faults`

    Raises RequestError for an unknown model or option, an impossible clock, or a name that is taken.
    """

    def __repr__(self) -> str:
        return f"<Simulation {self.url}, ids {', '.join(map(str, self.simulator.nodes))}>"

    def __init__(
        self,
        family: Family,
        ids: tuple[int, ...],
        *,
        model: str = "",
        clock: str = "virtual",
        name: str | None = None,
        faults: Faults = "",
        **options: object,
    ) -> None:
        if clock not in ("virtual", "real"):
            raise RequestError(f"clock {clock!r} is not possible", expected="virtual or real")
        self.family = family
        self.clock = clock
        self.pace = False
        named = {option.name for option in family.link.settings}
        self.settings = {option: value for option, value in options.items() if option in named}
        taken = {option.name for option in family.simulator_options()}
        options = {
            option: value for option, value in options.items() if option in taken or option not in named
        }
        self.simulator: Simulator = family.simulator(ids, model, **options)
        self._line: Line = PerfectLine()
        self._link: MemoryLink | Served | None = None
        self._left_at = 0.0 if clock == "virtual" else time.monotonic()
        self._away_until = -inf
        self._gate = Lock()
        self._world = World(self.simulator, port=self, now=self._left_at)
        self._devices: Simulator = self.simulator
        if faults:
            self.faults = faults
        self.name = _register(self, name)

    @property
    def url(self) -> str:
        """The address that `motorbus.open` takes, with the settings of the bus, and its rate if it is not the usual."""
        settings = "".join(f",{name}={value}" for name, value in {**self.settings, **self._rate()}.items())
        return f"{self.family.name}:sim:{self.name}{settings}"

    def _rate(self) -> dict[str, int]:
        """As an option of the address: devices that ship with another rate than most say so by `usual_rate`."""
        rate = getattr(self.simulator, "usual_rate", None)
        word = "baud" if self.family.link.kind == "bytes" else "bitrate"
        return {word: rate} if rate and rate != self.family.link.rate else {}

    @property
    def line(self) -> Line:
        """What lies between host and devices; set it to do harm, at any time."""
        return self._line

    @line.setter
    def line(self, line: Line) -> None:
        with self._gate:
            self._check_wire(line)
            self._line = line
            if self._link is not None:
                self._link.simulator, self._link.line = self._devices, line

    @property
    def faults(self) -> FaultyLine:
        """What happens by script, and what has happened; set a script to have it from now on, "" for none.

        Raises RequestError for a bad script, and for what these devices cannot do; the one before goes on then.
        """
        return self._line if isinstance(self._line, FaultyLine) else FaultyLine()

    @faults.setter
    def faults(self, script: Faults) -> None:
        given = requested(script)
        link = self._link
        if given.faults:
            self._check_wire()
        self._world.port = None if isinstance(link, Served) else self
        with link.still() if isinstance(link, Served) else nullcontext():
            self._world.now = max(self._world.now, self._now())
            line = FaultyLine(given, self._world)
            self._devices = self._world
            self.line = line

    def unplug(self, *, seconds: float) -> None:
        """Pull the port: whoever has it open gets LinkLost, and for so long (s) nobody can open it.

        Raises RequestError while it is served on a channel of somebody else.
        """
        if isinstance(self._link, Served):
            raise RequestError(f"{self.url} is served on a channel that cannot be pulled")
        self._away_until = self._now() + seconds
        if self._link is not None:
            self._link.unplug(seconds=seconds)

    @property
    def now(self) -> float:
        """The moment (s) on the devices' clock; a virtual one begins at 0."""
        return self._now()

    def wait(self, until: float) -> None:
        """Let time pass for the devices until this moment (s); when it has passed already, nothing happens.

        A virtual clock goes there at once, so simulations that all wait for the same moments have one clock.
        """
        seconds = until - self._now()
        if seconds <= 0:
            return
        if self.clock == "real" or isinstance(self._link, Served):
            time.sleep(seconds)
        elif self._link is not None:
            self._link.advance(seconds)
        else:
            self._left_at = until

    def __getitem__(self, node: int) -> Any:
        """The simulated device with this id: at least a `core.family.SimulatedNode`, and what its family adds.

        Raises RequestError when there is none.
        """
        try:
            return self.simulator.nodes[node]
        except KeyError:
            raise RequestError(
                f"{self.url} has no node {told(self.simulator, [node])}",
                expected=f"one of {told(self.simulator, self.simulator.nodes)}",
            ) from None

    def link(self, rate: int | None = None) -> MemoryLink:
        """A link that ends in this bus. Raises PortBusy while another one is open, PortNotFound after `close`."""
        with self._gate, _lock:
            self._check_free()
            self._check_there()
            link = _OneAtATime(self, rate or self.family.link.rate, self._left_at)
            self._link = link
            return link

    def serve(self, port: str, rate: int | None = None, **options: object) -> Served:
        """Put the devices on a CAN channel, such as `can://virtual/NAME` for python-can in this process.

        They work there in real time, by a thread, until what is given back is closed; use it in a `with`. `rate` is
        the bit rate of that bus, `options` are for its adapter. Raises RequestError for devices that do not speak CAN
        and for what is no channel, with faults for one on which there may be real devices, PortBusy while the
        simulation is open elsewhere, LinkError for the channel.
        """
        if self.family.link.kind != "frames":
            raise RequestError(f"{self.family.name} devices do not speak CAN")
        said, rate = rate or 0, rate or self.family.link.rate
        if any(fault.action == "unplug" for fault in self.faults.faults):
            raise RequestError(f"{port}: unplug pulls a port, and this channel is not ours to pull")
        with self._gate, _lock:
            self._check_free()
            if not is_calm(self._line):
                check_harmless(port)
            client = join(port, said, self.family.link.rate, **options)
            start = self._left_at if self.clock == "virtual" else None
            pace = rate if self.pace else None
            served = _ServedOne(self, client, line=self._line, pace=pace, rate=rate, start=start)
            self._link = served
            return served

    def close(self) -> None:
        """Forget its name; a link that is open goes dead. Calling it again does nothing."""
        with _lock:
            if _live.get((self.family.name, self.name)) is self:
                del _live[self.family.name, self.name]
        link = self._link
        if link is not None:
            link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _now(self) -> float:
        """The moment (s) on the devices' clock."""
        if self._link is not None:
            return self._link.now()
        return self._left_at if self.clock == "virtual" else time.monotonic()

    def _check_wire(self, line: Line | None = None) -> None:
        """No harm is done where a device may be real; None: the line does some."""
        if isinstance(self._link, Served) and self._link.real and (line is None or not is_calm(line)):
            raise on_a_wire(self._link.real)

    def _check_there(self) -> None:
        """The port has not been pulled; asking takes its time."""
        now = self._now()
        if now < self._away_until:
            if self.clock == "virtual":
                self._left_at += KNOCK
            raise PortNotFound(
                f"{self.url} is unplugged",
                cause="a fault of its script has pulled it",
                advice=f"it is there again in {self._away_until - now:g} s",
            )

    def _check_free(self) -> None:
        if _live.get((self.family.name, self.name)) is not self:
            raise _not_found(self.name, self.family.name)
        if self._link is not None:
            raise PortBusy(f"{self.url} is open already", advice="close the other bus first")

    def _release(self, link: MemoryLink | Served) -> None:
        with self._gate:
            if self._link is link:
                self._link, self._left_at = None, link.now()


def find(name: str, family: str) -> Simulation:
    """The live simulation of this name. Raises PortNotFound, which tells the names there are."""
    with _lock:
        try:
            return _live[family, name]
        except KeyError:
            raise _not_found(name, family) from None


def _register(simulation: Simulation, name: str | None) -> str:
    family = simulation.family.name
    with _lock:
        if name is None:
            name = next(text for text in map(str, _numbers) if (family, text) not in _live)
        elif not name or set(name) & set(",:#") or name != name.strip():
            raise RequestError(
                f"{name!r} cannot be the name of a bus", expected="no comma, colon, hash or margin"
            )
        elif (family, name) in _live:
            raise RequestError(
                f"{family}:sim:{name} exists already", advice="choose another name, or close it"
            )
        _live[family, name] = simulation
        return name


def _not_found(name: str, family: str) -> PortNotFound:
    names = ", ".join(sorted(f"{family}:sim:{other}" for kind, other in _live if kind == family))
    return PortNotFound(
        f"there is no simulated bus {family}:sim:{name} in this process",
        expected=f"one of {names}" if names else "",
        advice=f"make one by motorbus.simulate({family!r}, name={name!r}), or write {family}:sim,ids=1-6",
    )


class _OneAtATime(MemoryLink):
    """The memory link of a simulation; closing it lets the next host in, at the time at which this one left."""

    def __init__(self, simulation: Simulation, rate: int, start: float) -> None:
        self._simulation = simulation
        super().__init__(
            simulation._devices,
            rate=rate,
            line=simulation.line,
            virtual=simulation.clock == "virtual",
            pace=simulation.pace,
            name=simulation.url,
            start=start if simulation.clock == "virtual" else time.monotonic(),
        )

    def close(self) -> None:
        super().close()
        self._simulation._release(self)


class _ServedOne(Served):
    """A simulation at work elsewhere; closing it lets the next host in."""

    def __init__(
        self,
        simulation: Simulation,
        client: LinkClient,
        *,
        line: Line,
        pace: int | None,
        rate: int,
        start: float | None,
    ) -> None:
        self._simulation = simulation
        simulation.simulator.tune(rate)
        super().__init__(simulation._devices, client, line=line, pace=pace, rate=rate, start=start)

    def close(self) -> None:
        try:
            super().close()
        finally:
            self._simulation._release(self)
