"""The one place where address, family and link meet.

A bus is written FAMILY:PORT, options after commas, nodes after `#`:

    feetech:/dev/ttyACM0,baud=500000       feetech:socket://10.0.0.7:4000      feetech:COM7
    feetech:sim,ids=1-6,model=sts3215      feetech:sim:NAME                    feetech:/dev/ttyACM0#3

Opening writes nothing to any device: one read is sent, to learn whether the adapter echoes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Self
from weakref import WeakKeyDictionary

from motorbus import families
from motorbus.bus.aio import AsyncBus
from motorbus.bus.face import BusFace
from motorbus.bus.pump import Bus
from motorbus.core import units
from motorbus.core.family import Family
from motorbus.core.operation import Exchange
from motorbus.errors import MotorbusError, RequestError
from motorbus.journal import BusJournal, Change, told_by
from motorbus.link.base import Link
from motorbus.link.lock import journal_path, socket_path
from motorbus.link.memory import MemoryLink
from motorbus.link.url import open_link
from motorbus.motion.safety import Gate
from motorbus.simulation.named import Simulation, find

LOG = logging.getLogger("motorbus.session")
logging.getLogger("motorbus").addHandler(
    logging.NullHandler()
)  # silent until somebody asks; here, for nothing below logs
HIGHEST_NODE = 0x7FFFFFFF
ADAPTER = "can://"
"""Ports whose remaining options are the adapter's own; `link.can` knows which there are."""

Notify = Callable[[object], None]

_simulated: WeakKeyDictionary[Simulation, BusJournal] = WeakKeyDictionary()
"""The journals of simulated buses of this process, which end with them."""


class Address(NamedTuple):
    """A parsed bus address: `nodes` is () for the whole bus."""

    family: str
    port: str
    options: dict[str, str]
    nodes: tuple[int, ...] = ()

    @property
    def bus(self) -> str:
        """The address without its nodes."""
        options = "".join(f",{name}={value}" for name, value in self.options.items())
        return f"{self.family}:{self.port}{options}"


def parse_address(text: str) -> Address:
    """FAMILY:PORT[,option=value…][#ids] -> its parts. Raises RequestError with an example when it is none."""
    body, hash_, ids = text.partition("#")
    family, colon, rest = body.partition(":")
    port, *options = rest.split(",")
    if not (family and colon and port) or (hash_ and not ids):
        raise RequestError(
            f"{text!r} is not a bus address",
            expected="FAMILY:PORT, options after commas, ids after #",
            advice="for example feetech:/dev/ttyACM0,baud=1000000 or feetech:/dev/ttyACM0#3",
        )
    pairs = dict(_option(option, text) for option in options)
    return Address(family, port, pairs, parse_ids(ids) if ids else ())


def _option(text: str, address: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise RequestError(
            f"{address!r}: the option {text!r} has no value",
            expected="name=value after each comma",
            advice="for example feetech:sim,ids=1-6,model=sts3215",
        )
    return name, value


def parse_ids(text: str) -> tuple[int, ...]:
    """A list of ids, joined by `+` or `,`, ranges by `-`, decimal or 0x: `1-3+7`. Raises RequestError."""
    found: list[int] = []
    for part in text.replace("+", ",").split(","):
        low, dash, high = part.partition("-")
        try:
            first = int(low, 0)
            last = int(high, 0) if dash else first
        except ValueError:
            raise _bad_ids(text, f"{part!r} is not a number or a range") from None
        if not 0 <= first <= last or last - first > 0xFFFF or last > HIGHEST_NODE:
            raise _bad_ids(text, f"{part!r} is not an ascending range of ids")
        found += [node for node in range(first, last + 1) if node not in found]
    return tuple(found)


def _bad_ids(text: str, why: str) -> RequestError:
    return RequestError(f"ids {text!r}: {why}", expected="for example 3, 1-6 or 1-3+7")


class Opening(NamedTuple):
    """Everything needed to open a bus, found out and checked beforehand.

    `family` as this bus speaks it; `rate` in bit/s, 0 when nobody said; `options` for the simulator or the link.
    """

    family: Family
    port: str
    rate: int
    options: dict[str, object]


def prepare(address: str, options: dict[str, object]) -> Opening:
    """Check an address and its options without touching the port. Raises RequestError."""
    spot = parse_address(address)
    family = families.load(spot.family)
    merged: dict[str, object] = {**spot.options, **options}
    word = "baud" if family.link.kind == "bytes" else "bitrate"
    rate = _rate(word, merged.pop(word)) if word in merged else 0
    settings = {option.name: merged[option.name] for option in family.link.settings if option.name in merged}
    simulated = spot.port == "sim"
    known = {"ids", "model", *(option.name for option in family.link.options)} if simulated else set()
    rest = {name: value for name, value in merged.items() if name in known or name not in settings}
    unknown = sorted(set(rest) - known)
    if unknown and not spot.port.startswith(ADAPTER):
        allowed = {word, *known, *(option.name for option in family.link.settings)}
        raise RequestError(
            f"{address!r}: unknown option {unknown[0]!r}", expected=f"one of {', '.join(sorted(allowed))}"
        )
    return Opening(family.configured(**settings), spot.port, rate, rest)


def _rate(word: str, said: object) -> int:
    try:
        return units.rate(said)
    except RequestError as refusal:
        raise RequestError(
            f"{word}={said}: not a rate in bit/s", expected=refusal.expected, advice=refusal.advice
        ) from None


def lock_name(address: str, options: Mapping[str, object]) -> str:
    """What names the port of this bus where it is locked and listens for an emergency stop, however it was written.

    "" for a channel on which any number of programs meet, so that nobody owns it. Raises RequestError.
    """
    opening = prepare(address, dict(options))
    if not opening.port.startswith(ADAPTER):
        return opening.port
    from motorbus.link import can

    return can.lock_name(opening.port, opening.options)


def open(address: str, *, report: Notify | None = None, **options: object) -> Bus:
    """Open a bus, blocking; use it in a `with`.

    `report` gets progress, early results and journal records, the latter when they are on disk. Options may also stand
    in the address. A guarded change that was cut off is told as a warning of the bus, see `unfinished`. Raises
    RequestError for a bad address, PortNotFound, PortBusy (naming the owner) or LinkError for the port.
    """
    opening = prepare(address, options)
    link = _link(opening)
    try:
        journal = _journal(parse_address(address), options, opening, link)
        bus = Bus(
            link,
            opening.family,
            admit=Gate(),
            report=report,
            journal=journal,
            stop_socket=_stop_socket(opening, link),
        )
        _warn(bus, journal)
        test = _echo_test(bus)
        if test is not None:
            _settled(bus, lambda: bus.run(test))
    except BaseException:
        link.close()
        raise
    return bus


class OpenAsyncBus(AsyncBus):
    """An async bus that finds out about echo when its `async with` is entered."""

    async def __aenter__(self) -> Self:
        test = _echo_test(self)
        if test is not None:
            try:
                await self.run(test)
            except MotorbusError as silence:
                LOG.debug("echo test: %s", silence.summary)
            _tell_echo(self)
        return self


def open_async(address: str, *, report: Notify | None = None, **options: object) -> AsyncBus:
    """Open a bus for asyncio; use it in an `async with`. Arguments and errors as for `open`."""
    opening = prepare(address, options)
    link = _link(opening)
    try:
        journal = _journal(parse_address(address), options, opening, link)
        bus = OpenAsyncBus(
            link,
            opening.family,
            admit=Gate(),
            report=report,
            journal=journal,
            stop_socket=_stop_socket(opening, link),
        )
        _warn(bus, journal)
    except BaseException:
        link.close()
        raise
    return bus


def unfinished(bus: BusFace) -> Change | None:
    """The guarded change that was cut off on this bus, if there is one; `recover` of its device ends it.

    Raises RequestError when the journal was written by a later version.
    """
    return bus.journal.unfinished() if isinstance(bus.journal, BusJournal) else None


def journal_of(address: str) -> BusJournal | None:
    """The journal of a real port, open or not; None where none is kept. Raises RequestError for a bad address."""
    name = lock_name(address, {})
    simulated = name == "sim" or name.startswith("sim:")
    return _journal_on(address, name) if name and not simulated else None


def _journal_on(address: str, port: str) -> BusJournal:
    """The journal of this port; when nothing is unfinished there, that of a port which had this address when a change
    was cut off: the address may be a link, to an adapter that has come back under another name or not at all."""
    kept = BusJournal(address, journal_path(port))
    if kept.warning():
        return kept
    spot = parse_address(address)
    for path in told_by(lambda bus: parse_address(bus)[:2] == spot[:2]):
        return BusJournal(address, path)
    return kept


def simulate(
    family: str,
    *,
    ids: str | tuple[int, ...] = "1",
    model: str = "",
    clock: str = "virtual",
    name: str | None = None,
    **options: object,
) -> Simulation:
    """A simulated bus in this process; use it in a `with`, open it by its `url`, poke its nodes by `sim[3]`.

    `clock` is "virtual" (time passes only while somebody waits) or "real". Raises RequestError for an unknown
    family, model or option.
    """
    found = families.load(family)
    numbers = parse_ids(ids) if isinstance(ids, str) else ids
    return Simulation(found, numbers, model=model, clock=clock, name=name, **options)


def _link(opening: Opening) -> Link:
    family, rate = opening.family, opening.rate or opening.family.link.rate
    if opening.port == "sim":
        ids = parse_ids(str(opening.options.pop("ids", "1")))
        model = str(opening.options.pop("model", ""))
        simulator = family.simulator(ids, model, **opening.options)
        return MemoryLink(simulator, rate=rate, virtual=False, name=f"{family.name}:sim")
    if opening.port.startswith("sim:"):
        return find(opening.port.removeprefix("sim:"), family.name).link(rate)
    return open_link(
        opening.port,
        rate=opening.rate,
        usual=family.link.rate,
        kind=family.link.kind,
        options=opening.options,
    )


def _stop_socket(opening: Opening, link: Link) -> Path | None:
    if opening.port == "sim" or opening.port.startswith("sim:"):
        return None
    name: str = getattr(link, "lock_name", opening.port)
    return socket_path(name) if name else None


def _journal(spot: Address, options: Mapping[str, object], opening: Opening, link: Link) -> BusJournal | None:
    """Who records the changes on this bus; None for a channel that belongs to nobody, where none can be guarded."""
    merged = {**spot.options, **{name: str(value) for name, value in options.items()}}
    address = spot._replace(options=merged).bus
    if opening.port.startswith("sim:"):
        simulation = find(opening.port.removeprefix("sim:"), opening.family.name)
        return _simulated.setdefault(simulation, BusJournal(address))
    if opening.port == "sim":
        return BusJournal(address)
    name: str = getattr(link, "lock_name", opening.port)
    return _journal_on(address, name) if name else None


def _warn(bus: BusFace, journal: BusJournal | None) -> None:
    warning = journal.warning() if journal is not None else ""
    if warning:
        bus.warnings += (warning,)


def _echo_test(bus: BusFace) -> Exchange[Any] | None:
    for warning in bus.warnings:
        LOG.warning("%s: %s", bus.link.name, warning)
    test = bus.family.echo_test()
    if test is not None:
        bus.turns.expect_echo(test)
    return test


def _settled(bus: BusFace, run: Callable[[], object]) -> None:
    try:
        run()
    except MotorbusError as silence:
        LOG.debug("echo test: %s", silence.summary)
    _tell_echo(bus)


def _tell_echo(bus: BusFace) -> None:
    if bus.turns.echo.present:
        LOG.warning("%s: the adapter echoes what is sent; the echo is taken off", bus.link.name)
