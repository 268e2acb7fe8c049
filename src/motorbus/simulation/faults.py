"""Faults of a simulated bus as text: which packets suffer, and when ports and devices fail.

    seed 7; 1%: corrupt; exchange 17: drop; exchange 3 to device: drop; at 2.5 s: unplug 0.5

Faults stand on lines of their own or between semicolons; `#` begins a comment. Each strikes

    P%: KIND            packets by chance
    exchange N: KIND    one packet of exchange N; all that the host sends at once begins an exchange, the first is 1
    at T s: KIND        the first packet from T s on, or a port or device at T s; counted from when the faults are set

A packet goes to the host unless `to device` stands before the colon.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from math import isfinite
from typing import Final, NamedTuple

from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.link.base import Side

LONGEST: Final = 366 * 86_400.0
"""Maximum time of a fault (s)."""
EXAMPLE: Final = "for example `1%: corrupt; exchange 17: drop; at 2.5 s: unplug 0.5`"


class Kind(NamedTuple):
    """What a fault does, and its arguments: `seconds` is required, `until` and `node` are optional."""

    help: str
    seconds: bool = False
    until: bool = False
    node: bool = False
    packet: bool = True  # it happens to a packet; else to a port or to devices

    @property
    def form(self) -> str:
        """The arguments as text."""
        return " SECONDS" * self.seconds + "[-SECONDS]" * self.until + " [ID]" * self.node


KINDS: Final = {
    "drop": Kind("the packet is lost"),
    "corrupt": Kind("one byte is changed; a CAN frame is lost and the adapter reports an error"),
    "duplicate": Kind("the packet arrives twice"),
    "delay": Kind(
        "the packet arrives later, by a time in this range; later packets do not overtake it",
        seconds=True,
        until=True,
    ),
    "echo": Kind("the host receives the packet that it sent"),
    "unplug": Kind("the port is away; packets under way are lost", seconds=True, packet=False),
    "power-cycle": Kind("the devices restart", node=True, packet=False),
    "brown-out": Kind(
        "the devices have no supply for this time, then they restart", seconds=True, node=True, packet=False
    ),
}
_PLACE: Final = re.compile(
    r"(?:(?P<percent>[\d.e+-]+)\s*%|exchange\s+(?P<exchange>\d+)|at\s+(?P<moment>[\d.e+-]+)\s*s)"
    r"(?:\s+to\s+(?P<to>host|device))?"
)


class Fault(NamedTuple):
    """One fault; it prints as the text from which it is parsed. `percent`, `exchange` or `moment` (s) is set."""

    kind: str
    percent: float = 0.0
    exchange: int = 0
    moment: float | None = None
    to: Side = Side.HOST  # receiver of the packet
    seconds: float = 0.0
    until: float = 0.0  # end of a range that begins at `seconds`; 0: no range
    node: int | None = None  # None: all devices

    def __str__(self) -> str:
        place = f"{self.percent:.15g}%" if self.percent else f"exchange {self.exchange}"
        if self.moment is not None:
            place = f"at {self.moment:.15g} s"
        side = f" to {self.to.value}" if self.to is not _usual_side(self.kind) else ""
        seconds = f" {self.seconds:.15g}" if self.seconds else ""
        seconds += f"-{self.until:.15g}" if self.until else ""
        node = f" {self.node}" if self.node is not None else ""
        return f"{place}{side}: {self.kind}{seconds}{node}"


class Script(NamedTuple):
    """Faults and the seed of their chance."""

    faults: tuple[Fault, ...] = ()
    seed: int = 0

    def __str__(self) -> str:
        return "; ".join([f"seed {self.seed}"] * bool(self.seed) + [str(fault) for fault in self.faults])


def parse(text: str) -> Script:
    """Parse a script; "" has no faults. Raises RequestError that quotes the fault."""
    faults: list[Fault] = []
    seed = 0
    for line in text.splitlines():
        for part in line.partition("#")[0].split(";"):
            words = part.split()
            if words[:1] == ["seed"]:
                seed = _parse_seed(words[1:], part)
            elif words:
                faults.append(_parse_fault(" ".join(words)))
    return Script(tuple(faults), seed)


def _parse_seed(words: list[str], text: str) -> int:
    if len(words) != 1 or not words[0].isdecimal():
        raise RequestError(f"{text.strip()!r} is not a seed", expected="seed and a whole number, as seed 7")
    return int(words[0])


def _parse_fault(text: str) -> Fault:
    place, colon, what = text.partition(":")
    match = _PLACE.fullmatch(place.strip())
    name, *arguments = what.split() or [""]
    if not colon or match is None:
        raise RequestError(
            f"fault {text[:80]!r} has no place",
            expected="`P%: KIND`, `exchange N: KIND` or `at T s: KIND`",
            advice=EXAMPLE,
        )
    if name not in KINDS:
        near = get_close_matches(name, KINDS, n=1)
        raise RequestError(
            f"fault {text[:80]!r}: there is no kind {name!r}",
            expected=f"one of {', '.join(KINDS)}",
            advice=f"did you mean {near[0]}?" if near else EXAMPLE,
        )
    seconds, until, node = _parse_arguments(name, arguments, text)
    to = Side(match["to"]) if match["to"] else _usual_side(name)
    if to is not _usual_side(name) and (name == "echo" or not KINDS[name].packet):
        raise RequestError(f"fault {text!r}: {name} has no direction", expected="no `to`")
    found = Fault(name, to=to, seconds=seconds, until=until, node=node)
    if match["percent"]:
        return found._replace(percent=_number(match["percent"], 100.0, text))
    if match["moment"]:
        return found._replace(moment=_number(match["moment"], LONGEST, text, is_zero_valid=True))
    exchange = int(match["exchange"])
    if exchange < 1:
        raise RequestError(f"fault {text!r}: exchange {exchange} is not possible", expected="1 or more")
    return found._replace(exchange=exchange)


def _parse_arguments(name: str, words: list[str], text: str) -> tuple[float, float, int | None]:
    """`seconds`, `until` and `node` of a fault."""
    kind = KINDS[name]
    seconds = until = 0.0
    if kind.seconds and words:
        low, *high = re.split(r"(?<!e)-", words.pop(0), maxsplit=1)
        seconds = _number(low, LONGEST, text)
        until = _number(high[0], LONGEST, text) if high else 0.0
    try:
        node = units.whole(words.pop(0)) if kind.node and words else None
    except ValueError:
        raise RequestError(f"fault {text!r}: the id is not a number", expected=f"{name}{kind.form}") from None
    if until and (not kind.until or until <= seconds):
        raise RequestError(f"fault {text!r}: the range does not fit", expected=f"{name}{kind.form}")
    if words or (kind.seconds and not seconds):
        raise RequestError(f"fault {text!r}: the arguments do not fit", expected=f"{name}{kind.form}")
    return seconds, until, node


def _number(word: str, limit: float, text: str, *, is_zero_valid: bool = False) -> float:
    try:
        value = units.real(word)
    except ValueError:
        value = -1.0
    if not isfinite(value) or not 0 <= value <= limit or not (value or is_zero_valid):
        bound = "0 or more" if is_zero_valid else "more than 0"
        raise RequestError(
            f"fault {text!r}: {word} is not possible", expected=f"a number, {bound}, at most {limit:g}"
        )
    return value


def _usual_side(kind: str) -> Side:
    """The receiver of the packets that a fault of this kind strikes."""
    return Side.DEVICE if kind == "echo" or not KINDS[kind].packet else Side.HOST
