"""Opening a bus, blocking or async: link, family, gate and journal meet here.

One read is sent, which tells whether the adapter echoes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from motorbus import families
from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import Bus
from motorbus.errors import MotorbusError
from motorbus.journal import BusJournal
from motorbus.link.base import Link
from motorbus.link.lock import socket_path
from motorbus.link.reconnect import Reconnecting, reconnecting
from motorbus.link.url import open_link
from motorbus.motion.safety import Gate
from motorbus.session.address import parse_address, parse_ids
from motorbus.session.echo import LOG, echo_test, tell_echo
from motorbus.session.keeping import kept_for
from motorbus.session.opening import Opening, prepare, simulated
from motorbus.simulation.named import Faults, Simulation, find

if TYPE_CHECKING:
    from motorbus.bus.aio import AsyncBus

logging.getLogger("motorbus").addHandler(logging.NullHandler())  # silent by default

Notify = Callable[[object], None]
AnyBus = TypeVar("AnyBus", bound=BaseBus)


def open(address: str, *, report: Notify | None = None, **options: object) -> Bus:
    """Open a bus, blocking; use it in a `with`.

    `report` gets progress, early results and journal records, the latter when they are on disk. Options may also stand
    in the address. An unfinished guarded change is a warning of the bus, see `unfinished`. Raises
    RequestError for a bad address, PortNotFound, PortBusy (naming the owner) or LinkError for the port.
    """
    bus = _opened(Bus, address, report, options)
    try:
        test = echo_test(bus)
        if test is not None:
            _settled(bus, lambda: bus.run(test))
    except BaseException:
        bus.close()
        raise
    bus.defer_signals()
    return bus


def open_async(address: str, *, report: Notify | None = None, **options: object) -> AsyncBus:
    """Open a bus for asyncio; use it in an `async with`. Arguments and errors as for `open`."""
    from motorbus.session.awaited import OpenAsyncBus

    return _opened(OpenAsyncBus, address, report, options)


def _opened(
    kind: Callable[..., AnyBus], address: str, report: Notify | None, options: dict[str, object]
) -> AnyBus:
    """A bus of this kind on its open link, with its gate and its journal; nothing is sent."""
    opening = prepare(address, options)
    link = _link(opening)
    try:
        journal = kept_for(parse_address(address), options, opening, link)
        bus = kind(
            link,
            opening.driver,
            interlock=Gate(),
            report=report,
            journal=journal,
            stop_socket=_stop_socket(opening, link),
        )
        _look_for(bus, opening)
        _warn(bus, journal)
    except BaseException:
        link.close()
        raise
    return bus


def simulate(
    family: str,
    *,
    ids: str | tuple[int, ...] = "1",
    model: str = "",
    clock: str = "virtual",
    name: str | None = None,
    faults: Faults = "",
    **options: object,
) -> Simulation:
    """A simulated bus in this process; use it in a `with`, open it by its `url`, get its nodes by `sim[3]`.

    `clock` is "virtual" (time passes only while a caller waits) or "real"; `faults` is a script of faults, see
    `motorbus.simulation.faults`. Raises RequestError for an unknown family, model or option, and for a bad script.
    """
    found = families.load(family)
    numbers = parse_ids(ids) if isinstance(ids, str) else ids
    return Simulation(found, numbers, model=model, clock=clock, name=name, faults=faults, **options)


def _link(opening: Opening) -> Link:
    family = opening.family
    if opening.port == "sim":
        return simulated(opening)
    if opening.port.startswith("sim:"):
        return find(opening.port.removeprefix("sim:"), family.name).link(opening.rate or family.link.rate)
    said: Any = {
        "rate": opening.rate,
        "default_rate": family.link.rate,
        "kind": family.link.kind,
        "options": opening.options,
    }
    link = open_link(opening.port, **said)
    return reconnecting(link, **said) if opening.reconnect else link


def _look_for(bus: BaseBus, opening: Opening) -> None:
    """A port that comes back under another name is to be reached by an emergency stop under that one."""
    if not opening.reconnect:
        bus.reconnects = False
    elif isinstance(bus.link, Reconnecting):
        bus.link.on_rename = lambda name: bus.move_stop_socket(socket_path(name) if name else None)


def _stop_socket(opening: Opening, link: Link) -> Path | None:
    if opening.port == "sim" or opening.port.startswith("sim:"):
        return None
    name: str = getattr(link, "lock_name", opening.port)
    return socket_path(name) if name else None


def _warn(bus: BaseBus, journal: BusJournal | None) -> None:
    warning = journal.warning() if journal is not None else ""
    if warning:
        bus.warnings += (warning,)


def _settled(bus: BaseBus, run: Callable[[], object]) -> None:
    try:
        run()
    except MotorbusError as silence:
        LOG.debug("echo test: %s", silence.summary)
    tell_echo(bus)
