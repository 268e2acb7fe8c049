"""The journal of a bus: where its guarded changes are recorded, and whether one is unfinished."""

from __future__ import annotations

from collections.abc import Mapping
from weakref import WeakKeyDictionary

from motorbus.bus.base import BaseBus
from motorbus.journal import BusJournal, Change, find_files
from motorbus.link.base import Link
from motorbus.link.lock import journal_path
from motorbus.session.address import Address, parse_address
from motorbus.session.opening import Opening, lock_name
from motorbus.simulation.named import Simulation, find

_simulated: WeakKeyDictionary[Simulation, BusJournal] = WeakKeyDictionary()
"""The journals of simulated buses of this process, which end with them."""


def unfinished(bus: BaseBus) -> Change | None:
    """The unfinished guarded change of this bus, None if there is none; `recover` of its device ends it.

    Raises RequestError when the journal was written by a later version.
    """
    return bus.journal.unfinished() if isinstance(bus.journal, BusJournal) else None


def journal_of(address: str) -> BusJournal | None:
    """The journal of a real port, open or not; None where none is kept. Raises RequestError for a bad address."""
    name = lock_name(address, {})
    simulated = name == "sim" or name.startswith("sim:")
    return _journal_on(address, name) if name and not simulated else None


def _journal_on(address: str, port: str) -> BusJournal:
    """The journal of this port, or of a port that had this address when a change was left unfinished.

    The address may be a link to an adapter that is gone or has another name now.
    """
    kept = BusJournal(address, journal_path(port))
    if kept.warning():
        return kept
    spot = parse_address(address)
    for path in find_files(lambda bus: parse_address(bus)[:2] == spot[:2]):
        return BusJournal(address, path)
    return kept


def kept_for(spot: Address, options: Mapping[str, object], opening: Opening, link: Link) -> BusJournal | None:
    """The journal of this bus; None for a channel that several programs share, where no change can be guarded."""
    merged = {**spot.options, **{name: str(value) for name, value in options.items()}}
    address = spot._replace(options=merged).bus
    if opening.port.startswith("sim:"):
        simulation = find(opening.port.removeprefix("sim:"), opening.family.name)
        return _simulated.setdefault(simulation, BusJournal(address))
    if opening.port == "sim":
        return BusJournal(address)
    name: str = getattr(link, "lock_name", opening.port)
    return _journal_on(address, name) if name else None
