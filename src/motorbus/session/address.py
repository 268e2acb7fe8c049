"""How a bus and its devices are written: FAMILY:PORT, options after commas, nodes after `#`.

Only the form is judged here; what a family makes of it is `opening`.
"""

from __future__ import annotations

from typing import NamedTuple

from motorbus.core import units
from motorbus.errors import RequestError

HIGHEST_NODE = 0x7FFFFFFF


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
    pairs: dict[str, str] = {}
    for name, value in (_option(option, text) for option in options):
        if pairs.setdefault(name, value) != value:
            raise RequestError(
                f"{text!r}: the option {name} is given twice, as {pairs[name]} and {value}",
                expected="each option once",
                advice="leave one of them out; nothing was sent",
            )
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
            first = units.whole(low)
            last = units.whole(high) if dash else first
        except ValueError:
            raise _bad_ids(text, f"{part!r} is not a number or a range") from None
        if not 0 <= first <= last or last - first > 0xFFFF or last > HIGHEST_NODE:
            raise _bad_ids(text, f"{part!r} is not an ascending range of ids")
        found += [node for node in range(first, last + 1) if node not in found]
    return tuple(found)


def _bad_ids(text: str, why: str) -> RequestError:
    return RequestError(f"ids {text!r}: {why}", expected="for example 3, 1-6 or 1-3+7")
