"""Open a bus, blocking or async: its link, driver, interlock, journal and stop socket. Make a simulated bus."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from motorbus import families
from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import Bus
from motorbus.bus.interlock import DeviceLimits, Interlock
from motorbus.errors import MotorbusError, RequestError
from motorbus.link.base import Link
from motorbus.link.lock import socket_path
from motorbus.link.memory import MemoryLink
from motorbus.link.reconnect import Reconnecting, reconnecting
from motorbus.link.url import open_link
from motorbus.session.address import parse_ids
from motorbus.session.echo import LOG, echo_test, warn_of_echo
from motorbus.session.journals import journal_for
from motorbus.session.options import Opening, is_simulated, prepare
from motorbus.simulation import Simulation, find
from motorbus.simulation.faulty import FaultyBus

if TYPE_CHECKING:
    from motorbus.bus.aio import AsyncBus

logging.getLogger("motorbus").addHandler(logging.NullHandler())  # silent by default

Notify = Callable[[object], None]
AnyBus = TypeVar("AnyBus", bound=BaseBus)


def open(
    address: str, *, report: Notify | None = None, interlock: Interlock | None = None, **options: object
) -> Bus:
    """Open a bus, blocking; use it in a `with`.

    `report` gets progress, early results and journal entries, the latter when they are on disk. `interlock` judges
    motion requests, by default `DeviceLimits`. Options may also stand in the address. An unfinished guarded change is a
    warning of the bus, see `unfinished`. Raises RequestError for a bad address, PortNotFound, PortBusy (with the owner)
    or LinkError for the port.
    """
    bus = _make(Bus, address, report, interlock, options)
    try:
        test = echo_test(bus)
        if test is not None:
            try:
                bus.run(test)
            except MotorbusError as silence:
                LOG.debug("echo test: %s", silence.summary)
            warn_of_echo(bus)
    except BaseException:
        bus.close()
        raise
    bus.defer_signals()
    return bus


def open_async(
    address: str, *, report: Notify | None = None, interlock: Interlock | None = None, **options: object
) -> AsyncBus:
    """Open a bus for asyncio; use it in an `async with`. Arguments and errors as for `open`."""
    from motorbus.session.opening_async import OpenAsyncBus  # a blocking program does not import asyncio

    return _make(OpenAsyncBus, address, report, interlock, options)


def simulate(
    family: str,
    *,
    ids: str | tuple[int, ...] = "1",
    model: str = "",
    clock: str = "virtual",
    name: str | None = None,
    faults: str = "",
    **options: object,
) -> Simulation:
    """A simulated bus in this process; use it in a `with`, open it by its `url`, use its devices by `sim[3]`.

    `clock` is "virtual" (time passes only while a caller waits) or "real"; `faults` is a script, see
    `motorbus.simulation.faults`. Raises RequestError for an unknown family, model or option, and for a bad script.
    """
    found = families.load(family)
    numbers = parse_ids(ids) if isinstance(ids, str) else ids
    return Simulation(found, numbers, model=model, clock=clock, name=name, faults=faults, **options)


def simulated_link(opening: Opening) -> MemoryLink:
    """Make the simulated devices of an address with the port `sim`, and the link to them.

    `clock=virtual` suits a program that only waits for its bus. Raises RequestError for bad ids, an unknown model, a
    bad option or bad faults.
    """
    family, options = opening.family, dict(opening.options)
    ids = parse_ids(str(options.pop("ids", "1")))
    model, faults = str(options.pop("model", "")), str(options.pop("faults", ""))
    clock = options.pop("clock", "real")
    if clock not in ("virtual", "real"):
        raise RequestError(f"clock={clock} is not possible", expected="virtual or real")
    simulator = family.simulator(ids, model, **options)
    link = MemoryLink(
        simulator,
        rate=opening.rate or family.link.rate,
        virtual=clock == "virtual",
        name=f"{family.name}:sim",
    )
    if faults:
        bus = FaultyBus(simulator, lambda seconds: link.unplug(seconds=seconds))
        bus.set(faults, link.now())
        link.simulator, link.line = bus, bus
    return link


def _make(
    kind: Callable[..., AnyBus],
    address: str,
    report: Notify | None,
    interlock: Interlock | None,
    options: dict[str, object],
) -> AnyBus:
    """A bus of this kind on its open link; nothing is sent."""
    opening = prepare(address, options)
    link = _open_link(opening)
    try:
        journal = journal_for(address, options, opening, link)
        bus = kind(
            link,
            opening.driver,
            interlock=DeviceLimits() if interlock is None else interlock,
            report=report,
            journal=journal,
            stop_socket=_stop_socket(opening, link),
        )
        if not opening.reconnect:
            bus.reconnects = False
        elif isinstance(bus.link, Reconnecting):  # an emergency stop finds the port under its new name
            bus.link.on_rename = lambda name: bus.move_stop_socket(socket_path(name) if name else None)
        if journal is not None and (warning := journal.warning()):
            bus.warnings += (warning,)
    except BaseException:
        link.close()
        raise
    return bus


def _open_link(opening: Opening) -> Link:
    family = opening.family
    if opening.port == "sim":
        return simulated_link(opening)
    if is_simulated(opening.port):
        return find(opening.port.removeprefix("sim:"), family.name).link(opening.rate or family.link.rate)
    arguments: dict[str, Any] = {
        "rate": opening.rate,
        "default_rate": family.link.rate,
        "kind": family.link.kind,
        "options": opening.options,
    }
    link = open_link(opening.port, **arguments)
    return reconnecting(link, **arguments) if opening.reconnect else link


def _stop_socket(opening: Opening, link: Link) -> Path | None:
    if is_simulated(opening.port):
        return None
    name: str = getattr(link, "lock_name", opening.port)
    return socket_path(name) if name else None
