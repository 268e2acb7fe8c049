"""The text form of a bus and its devices: FAMILY:PORT, options after commas, nodes after `#`."""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core import units
from motorbus.errors import RequestError

MAX_NODE: Final = 0x7FFF_FFFF
MAX_SPAN: Final = 0xFFFF  # ids of one range


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
    """Parse FAMILY:PORT[,option=value…][#ids]. Raises RequestError with an example."""
    body, hash_, ids = text.partition("#")
    family, colon, rest = body.partition(":")
    port, *words = rest.split(",")
    if not (family and colon and port) or (hash_ and not ids):
        raise RequestError(
            f"{text!r} is not a bus address",
            expected="FAMILY:PORT, options after commas, ids after #",
            advice="for example feetech:/dev/ttyACM0,baud=1000000 or feetech:/dev/ttyACM0#3",
        )
    options: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (name and equals and value):
            raise RequestError(
                f"{text!r}: the option {word!r} has no value",
                expected="name=value after each comma",
                advice="for example feetech:sim,ids=1-6,model=sts3215",
            )
        if options.setdefault(name, value) != value:
            raise RequestError(
                f"{text!r}: the option {name} is given twice, as {options[name]} and {value}",
                expected="each option once",
                advice="leave one of them out; nothing was sent",
            )
    return Address(family, port, options, parse_ids(ids) if ids else ())


def parse_ids(text: str) -> tuple[int, ...]:
    """Parse ids joined by `+` or `,`, ranges by `-`, decimal or 0x: `1-3+7`. Raises RequestError."""
    found: dict[int, None] = {}
    for part in text.replace("+", ",").split(","):
        low, dash, high = part.partition("-")
        try:
            first = units.whole(low)
            last = units.whole(high) if dash else first
        except ValueError:
            raise _bad_ids(text, f"{part!r} is not a number or a range") from None
        if not 0 <= first <= last <= MAX_NODE or last - first > MAX_SPAN:
            raise _bad_ids(text, f"{part!r} is not an ascending range of ids")
        found.update(dict.fromkeys(range(first, last + 1)))
    return tuple(found)


def _bad_ids(text: str, reason: str) -> RequestError:
    return RequestError(f"ids {text!r}: {reason}", expected="for example 3, 1-6 or 1-3+7")
