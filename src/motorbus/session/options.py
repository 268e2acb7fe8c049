"""An address and its options, checked before a port is opened: family, port, rate, options.

Every bus has the options `baud` or `bitrate` and `reconnect`; a serial port has `latency`; a bus of simulated devices
(port `sim`) has `ids`, `model`, `clock`, `faults` and the options of its family.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Final, NamedTuple

from motorbus import families
from motorbus.core import units
from motorbus.core.family import BusDriver, Family
from motorbus.errors import RequestError
from motorbus.session.address import parse_address

MAX_LATENCY: Final = 1.0  # s
CAN: Final = "can://"
"""Ports whose other options belong to the adapter; `link.can` checks them."""
SIMULATED: Final = ("ids", "model", "clock", "faults")
MAX_NAMED: Final = 12  # options in a message


class Opening(NamedTuple):
    """All that is needed to open a bus.

    `rate` is in bit/s, 0 if not given; `options` are for the simulator or the link; with `reconnect` a lost port is
    opened again when it is back.
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


def is_simulated(port: str) -> bool:
    """Whether the port of an address is a simulated bus of this process."""
    return port == "sim" or port.startswith("sim:")


def prepare(address: str, options: Mapping[str, object]) -> Opening:
    """Check an address and its options without opening the port. Raises RequestError."""
    spot = parse_address(address)
    family = families.load(spot.family)
    given: dict[str, object] = {**spot.options, **options}
    is_bytes = family.link.kind == "bytes"
    rate_name = "baud" if is_bytes else "bitrate"
    rate = _parse_rate(rate_name, given.pop(rate_name)) if rate_name in given else 0
    reconnect = _parse_switch("reconnect", given.pop("reconnect", True))
    timing: dict[str, object] = {}
    has_latency = is_bytes and not is_simulated(spot.port)
    if has_latency and "latency" in given:
        timing["latency"] = _parse_latency(given.pop("latency"))
    if "faults" in given and spot.port != "sim":
        raise _no_faults(address, spot.port)
    names = [option.name for option in family.link.settings]
    settings = {name: given[name] for name in names if name in given}
    known: list[str] = []
    if spot.port == "sim":
        known = [*SIMULATED, *(option.name for option in family.simulator_options())]
    rest = {name: value for name, value in given.items() if name in known or name not in settings}
    unknown = [name for name in rest if name not in known]
    if unknown and not spot.port.startswith(CAN):
        latency = ["latency"] if has_latency else []
        raise _unknown(address, unknown[0], [rate_name, *known[:4], *names, *latency, "reconnect", *known])
    return Opening(family.open(**settings), spot.port, rate, {**rest, **timing}, reconnect)


def lock_name(address: str, options: Mapping[str, object]) -> str:
    """The name of the port of this bus for its lock and its stop socket, the same for all spellings of the address.

    "" for a channel that several programs share. Raises RequestError.
    """
    port = prepare(address, options).port
    if not port.startswith(CAN):
        return port
    from motorbus.link.can import read_address

    return read_address(port).lock_name


def _parse_rate(name: str, value: object) -> int:
    try:
        return units.rate(value)
    except RequestError as error:
        raise RequestError(
            f"{name}={value}: not a rate in bit/s", expected=error.expected, advice=error.advice
        ) from None


def _parse_switch(name: str, value: object) -> bool:
    if isinstance(value, bool):
        return value
    if value not in ("yes", "no"):
        raise RequestError(f"{name}={value}: neither yes nor no", expected="yes or no")
    return value == "yes"


def _parse_latency(value: object) -> float:
    """The time (s) that the adapter of a serial port holds bytes back."""
    try:
        seconds = units.parse(str(value), "time")
    except RequestError as error:
        raise RequestError(f"latency={value}: {error.summary}", expected=error.expected) from None
    if not 0 <= seconds <= MAX_LATENCY:
        raise RequestError(
            f"latency={value}: no adapter holds bytes back for that long",
            expected=f"0 to {MAX_LATENCY:g} s, as 0, 1ms or 500us; 0 for a line without an adapter",
        )
    return seconds


def _unknown(address: str, name: str, known: Iterable[str]) -> RequestError:
    """The error for an unknown option; the most usual of the `known` come first."""
    names = list(dict.fromkeys(known))
    near = get_close_matches(name.lower()[:80], names, n=1)
    advice = f"did you mean {near[0]}?" if near else "take it out of the address"
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return RequestError(
        f"{address!r}: unknown option {name!r}",
        expected=f"one of {', '.join(names[:MAX_NAMED])}{more}",
        advice=f"{advice}; nothing was opened",
    )


def _no_faults(address: str, port: str) -> RequestError:
    if is_simulated(port):
        return RequestError(
            f"{address!r}: faults cannot be put in front of this bus: nothing was opened",
            advice="set `faults` of the simulation that it belongs to",
        )
    return RequestError(
        f"{address!r}: faults cannot be put in front of a port: nothing was opened",
        expected="a simulated bus, as FAMILY:sim,ids=1-6 with faults",
        cause="real devices may be behind a port",
        advice="give them to the simulator: motorbus simulate FAMILY --faults",
    )
