"""What an address comes to before a port is touched: family, port, rate, and options that somebody takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from motorbus import families
from motorbus.core import units
from motorbus.core.family import Family
from motorbus.errors import RequestError
from motorbus.session.address import parse_address

FAULTS = "faults"
"""What goes wrong by script, for simulated devices only; see `motorbus.simulation.faults`."""
ADAPTER = "can://"
"""Ports whose remaining options are the adapter's own; `link.can` knows which there are."""

RECONNECT = "reconnect"
"""The option of every bus that says whether a port that was lost is looked for."""


class Opening(NamedTuple):
    """Everything needed to open a bus, found out and checked beforehand.

    `family` as this bus speaks it; `rate` in bit/s, 0 when nobody said; `options` for the simulator or the link.
    `reconnect`: a port that is lost is opened anew when it is there again.
    """

    family: Family
    port: str
    rate: int
    options: dict[str, object]
    reconnect: bool = True


def prepare(address: str, options: dict[str, object]) -> Opening:
    """Check an address and its options without touching the port. Raises RequestError."""
    spot = parse_address(address)
    family = families.load(spot.family)
    merged: dict[str, object] = {**spot.options, **options}
    word = "baud" if family.link.kind == "bytes" else "bitrate"
    rate = _rate(word, merged.pop(word)) if word in merged else 0
    reconnect = _yes(RECONNECT, merged.pop(RECONNECT, True))
    settings = {option.name: merged[option.name] for option in family.link.settings if option.name in merged}
    simulated = spot.port == "sim"
    if FAULTS in merged and not simulated:
        raise _no_faults(address, spot.port)
    known = {"ids", "model", FAULTS, *(option.name for option in family.link.options)} if simulated else set()
    rest = {name: value for name, value in merged.items() if name in known or name not in settings}
    unknown = sorted(set(rest) - known)
    if unknown and not spot.port.startswith(ADAPTER):
        allowed = {word, RECONNECT, *known, *(option.name for option in family.link.settings)}
        raise RequestError(
            f"{address!r}: unknown option {unknown[0]!r}", expected=f"one of {', '.join(sorted(allowed))}"
        )
    return Opening(family.configured(**settings), spot.port, rate, rest, reconnect)


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
    """What names the port of this bus where it is locked and listens for an emergency stop, however it was written.

    "" for a channel on which any number of programs meet, so that nobody owns it. Raises RequestError.
    """
    opening = prepare(address, dict(options))
    if not opening.port.startswith(ADAPTER):
        return opening.port
    from motorbus.link import can

    return can.lock_name(opening.port, opening.options)
