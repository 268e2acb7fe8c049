"""An address and its options, checked before a port is opened: family, port, rate, options."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from motorbus import families
from motorbus.core import units
from motorbus.core.family import BusDriver, Family
from motorbus.errors import RequestError
from motorbus.link.memory import MemoryLink
from motorbus.session.address import parse_address, parse_ids
from motorbus.simulation.faults import strike

LATEST = 1.0  # s
FAULTS = "faults"
"""The option for a script of faults, for simulated devices only; see `motorbus.simulation.faults`."""
ADAPTER = "can://"
"""Ports whose remaining options belong to the adapter; `link.can` checks them."""

LATENCY = "latency"
"""The option of every serial port for the time (s) that its adapter holds bytes back."""
RECONNECT = "reconnect"
"""The option of every bus for whether a lost port is opened again."""


class Opening(NamedTuple):
    """All that is needed to open a bus.

    `driver` is that of this bus; `rate` in bit/s, 0 if not given; `options` are for the simulator or the link.
    `reconnect`: a lost port is opened again when it is back.
    """

    driver: BusDriver
    port: str
    rate: int
    options: dict[str, object]
    reconnect: bool = True

    @property
    def family(self) -> Family:
        """The family of the devices."""
        return self.driver.family


def prepare(address: str, options: dict[str, object]) -> Opening:
    """Check an address and its options without touching the port. Raises RequestError."""
    spot = parse_address(address)
    family = families.load(spot.family)
    merged: dict[str, object] = {**spot.options, **options}
    word = "baud" if family.link.kind == "bytes" else "bitrate"
    rate = _rate(word, merged.pop(word)) if word in merged else 0
    reconnect = _yes(RECONNECT, merged.pop(RECONNECT, True))
    timing = _timing(merged) if _is_serial(family, spot.port) else {}
    settings = {option.name: merged[option.name] for option in family.link.settings if option.name in merged}
    simulated = spot.port == "sim"
    if FAULTS in merged and not simulated:
        raise _no_faults(address, spot.port)
    known = (
        {"ids", "model", FAULTS, *(option.name for option in family.simulator_options())}
        if simulated
        else set()
    )
    rest = {name: value for name, value in merged.items() if name in known or name not in settings}
    unknown = sorted(set(rest) - known)
    if unknown and not spot.port.startswith(ADAPTER):
        more = {LATENCY} if _is_serial(family, spot.port) else set()
        here = [option.name for option in family.link.settings]
        usual = [name for name in ("ids", "model", FAULTS) if name in known]
        raise _unknown(address, unknown[0], [word, *usual, *here, *sorted(more), RECONNECT, *sorted(known)])
    return Opening(family.open(**settings), spot.port, rate, {**rest, **timing}, reconnect)


def simulated(opening: Opening) -> MemoryLink:
    """Make the simulated devices of an address with the port `sim`, on a bus in memory.

    Raises RequestError for bad ids, an unknown model, a bad option or bad faults.
    """
    family, options = opening.family, dict(opening.options)
    ids = parse_ids(str(options.pop("ids", "1")))
    model, faults = str(options.pop("model", "")), options.pop(FAULTS, "")
    simulator = family.simulator(ids, model, **options)
    rate = opening.rate or family.link.rate
    memory = MemoryLink(simulator, rate=rate, virtual=False, name=f"{family.name}:sim")
    if faults:
        strike(memory, str(faults))
    return memory


def _unknown(address: str, option: str, known: Iterable[str]) -> RequestError:
    """The error for an unknown option; the most usual of the `known` come first."""
    from motorbus.motion.machine.refusal import listed, nearest  # opening a bus imports no machine

    there = dict.fromkeys(known)
    return RequestError(
        f"{address!r}: unknown option {option!r}",
        expected=listed(there),
        advice=f"{nearest(option, there, 'take it out of the address')}; nothing was opened",
    )


def _is_serial(family: Family, port: str) -> bool:
    """A port that carries bytes, and is not a simulator in this process."""
    return family.link.kind == "bytes" and port.partition(":")[0] != "sim"


def _timing(merged: dict[str, object]) -> dict[str, object]:
    """Remove the options about reply times and return them as the link takes them."""
    return {LATENCY: _latency(merged.pop(LATENCY))} if LATENCY in merged else {}


def _latency(said: object) -> float:
    """The option in s."""
    try:
        seconds = units.parse(str(said), "time")
    except RequestError as refusal:
        raise RequestError(f"{LATENCY}={said}: {refusal.summary}", expected=refusal.expected) from None
    if not 0 <= seconds <= LATEST:
        raise RequestError(
            f"{LATENCY}={said}: no adapter holds bytes back for that long",
            expected=f"0 to {LATEST:g} s, as 0, 1ms or 500us; 0 for a line without an adapter",
        )
    return seconds


def _no_faults(address: str, port: str) -> RequestError:
    """Faults are for simulated devices: there is no way to put them in front of a port."""
    here = port.startswith("sim:")
    return RequestError(
        f"{address!r}: {FAULTS} cannot be put in front of {'this bus' if here else 'a port'}: nothing was opened",
        expected=f"a simulated bus, as FAMILY:sim,ids=1-6 with {FAULTS}",
        cause="" if here else "whatever is behind a port may be real",
        advice="set `faults` of the simulation that it belongs to"
        if here
        else "tell the simulator: motorbus simulate FAMILY --faults",
    )


def _yes(word: str, said: object) -> bool:
    if isinstance(said, bool):
        return said
    if said not in ("yes", "no"):
        raise RequestError(f"{word}={said}: neither yes nor no", expected="yes or no")
    return said == "yes"


def _rate(word: str, said: object) -> int:
    try:
        return units.rate(said)
    except RequestError as refusal:
        raise RequestError(
            f"{word}={said}: not a rate in bit/s", expected=refusal.expected, advice=refusal.advice
        ) from None


def lock_name(address: str, options: Mapping[str, object]) -> str:
    """The name of the port of this bus, for its lock and its stop socket, the same for all spellings of the address.

    "" for a channel that several programs share. Raises RequestError.
    """
    opening = prepare(address, dict(options))
    if not opening.port.startswith(ADAPTER):
        return opening.port
    from motorbus.link.can import read_address

    return read_address(opening.port).lock_name
