"""Which journal a bus has, and whether one of its changes is unfinished."""

from __future__ import annotations

from collections.abc import Mapping
from weakref import WeakKeyDictionary

from motorbus.bus.base import BaseBus
from motorbus.journal import BusJournal, Change, find_files
from motorbus.link.base import Link
from motorbus.link.lock import journal_path
from motorbus.session.address import parse_address
from motorbus.session.options import Opening, is_simulated, lock_name
from motorbus.simulation import Simulation, find

_simulated: WeakKeyDictionary[Simulation, BusJournal] = WeakKeyDictionary()
"""The journals of simulated buses of this process, which end with them."""


def unfinished(bus: BaseBus) -> Change | None:
    """The unfinished guarded change of this bus; `recover` of its device ends it.

    Raises RequestError when a later version wrote the journal.
    """
    return bus.journal.unfinished() if isinstance(bus.journal, BusJournal) else None


def journal_of(address: str) -> BusJournal | None:
    """The journal of a real port, open or not; None where none is kept. Raises RequestError for a bad address."""
    name = lock_name(address, {})
    return _find(address, name) if name and not is_simulated(name) else None


def journal_for(
    address: str, options: Mapping[str, object], opening: Opening, link: Link
) -> BusJournal | None:
    """The journal of a bus that is opened; None for a channel that several programs share: no change is guarded there.

    Its address holds the options, so that a message about an unfinished change names the bus as it was opened.
    """
    spot = parse_address(address)
    texts = {name: str(value) for name, value in options.items()}
    bus = spot._replace(options={**spot.options, **texts}).bus
    if opening.port == "sim":
        return BusJournal(bus)
    if is_simulated(opening.port):
        simulation = find(opening.port.removeprefix("sim:"), opening.family.name)
        return _simulated.setdefault(simulation, BusJournal(bus))
    name: str = getattr(link, "lock_name", opening.port)
    return _find(bus, name) if name else None


def _find(address: str, port: str) -> BusJournal:
    """The journal of this port, or that of a port which had this address when a change was left unfinished.

    The address may be a link to an adapter that is gone or has another name now.
    """
    journal = BusJournal(address, journal_path(port))
    if journal.warning():
        return journal
    spot = parse_address(address)
    for path in find_files(lambda bus: parse_address(bus)[:2] == spot[:2]):
        return BusJournal(address, path)
    return journal
