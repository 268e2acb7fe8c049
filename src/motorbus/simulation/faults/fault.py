"""One fault: where or when or how often, and what. A value that prints as the text it is parsed from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from random import Random
from types import MappingProxyType
from typing import Final

from motorbus.errors import RequestError
from motorbus.link.base import Side
from motorbus.simulation.faults.words import WORDS, Takes, Word

ANY: Final = -1
"""In place of bits, a bit or a byte: whichever, by chance."""
_BY_CHANCE: Final = (Takes.BITS, Takes.BIT, Takes.BYTE)
_VALUES: Final[Mapping[Takes, range]] = MappingProxyType(
    {
        Takes.BITS: range(1, 256),
        Takes.BIT: range(8),
        Takes.BYTE: range(256),
        Takes.PERHAPS_COUNT: range(1 << 16),
    }
)
LONGEST: Final = 366 * 86_400.0
"""s that a fault may take or be away: a leap year. Longer ones are slips, and clocks lose their digits over them."""
FARTHEST: Final = 10**12
"""The last exchange, packet or byte that can be named: 30 000 exchanges a second for a year. Beyond it are slips."""
_TIMED: Final = (Takes.SECONDS, Takes.SPAN, Takes.SECONDS_NODE)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault. Raises RequestError when it is impossible or would change nothing.

    `exchange`  1 is the first thing the host sends, the next thing it sends begins exchange 2; 0 is before all of that
    `byte`      counted from 0 in the direction `to` within the exchange; `insert` may stand behind the last one. For
                a CAN frame these are its data bytes, changed behind the check sum, where no wire could
    `action`    a word of `WORDS`
    `to`        the side it strikes what goes to; left out, the host, and for `echo` and what happens to devices the
                device
    `value`     of corrupt, flip, insert the bits, the bit, the byte (`ANY`: by chance); of echo how many bytes, 0 all
    `seconds`   of what takes its time; `until` above 0: anything between the two, by chance
    `packet`    without a byte: which one in this direction within the exchange, from 1
    `percent`   above 0: by chance, for every packet or, `per_byte`, for every byte; there is no exchange then
    `moment`    s from the beginning: the first packet from then on, or devices at that very moment
    `node`      whom it happens to; None: all
    """

    exchange: int | None = None
    byte: int | None = None
    action: str = ""
    to: Side = None  # type: ignore[assignment]  # until it is made: the usual side of the word
    value: int = 0
    seconds: float = 0.0
    packet: int = 1
    percent: float = 0.0
    per_byte: bool = False
    moment: float | None = None
    node: int | None = None
    until: float = 0.0

    def __post_init__(self) -> None:
        if self.action not in WORDS:
            raise RequestError(f"fault {self.action!r} is not known", expected=f"one of {', '.join(WORDS)}")
        if self.to is None:
            object.__setattr__(self, "to", Side.DEVICE if self.word.outward else Side.HOST)
        _check_place(self)
        _check_what(self)

    @property
    def word(self) -> Word:
        """What its action means."""
        return WORDS[self.action]

    @property
    def by_chance(self) -> bool:
        """Whether a seed decides anything of it."""
        loose = self.word.takes in _BY_CHANCE and self.value == ANY
        return bool(self.percent or self.until) or loose or (self.byte is None and self.action in SOMEWHERE)

    def __str__(self) -> str:
        usual = Side.DEVICE if self.word.outward else Side.HOST
        side = "" if self.to is usual else f" to {self.to.value}"
        argument = _ARGUMENTS.get(self.word.takes, _nothing)(self)
        return f"{_where(self)}{side}: {self.action}{argument}"

    def settled(self, exchange: int, packet: int, byte: int | None, random: Random) -> Fault:
        """The same by position, with whatever chance has left open."""
        value = self.value
        if value == ANY and self.word.takes in _BY_CHANCE and byte is not None:
            value = random.choice(_VALUES[self.word.takes])
        seconds = random.uniform(self.seconds, self.until) if self.until else self.seconds
        return replace(
            self,
            exchange=exchange,
            packet=1 if byte is not None else packet,
            byte=byte,
            value=value,
            seconds=seconds,
            until=0.0,
            percent=0.0,
            per_byte=False,
            moment=None,
        )


SOMEWHERE: Final = ("corrupt", "flip", "insert", "truncate")
"""What needs a byte: without one it is chosen by chance."""


def _check_place(fault: Fault) -> None:
    ways = (fault.exchange is not None, fault.percent != 0, fault.moment is not None)
    if sum(ways) != 1:
        raise RequestError(f"fault {fault.action}: an exchange, a chance or a moment, and one of them only")
    if (fault.exchange or 0) < 0 or (fault.byte or 0) < 0 or fault.packet < 1:
        raise RequestError(f"fault {fault}: exchanges and packets count from 1 and bytes from 0")
    if max(fault.exchange or 0, fault.byte or 0, fault.packet) > FARTHEST:
        raise RequestError(
            f"fault {fault}: no run comes that far",
            expected=f"exchanges, packets and bytes up to {FARTHEST:,}",
        )
    if fault.byte is not None and (fault.exchange is None or fault.packet != 1):
        raise RequestError(f"fault {fault}: a byte is counted within an exchange")
    if not (isfinite(fault.percent) and 0 <= fault.percent <= 100):
        raise RequestError(f"fault {fault}: impossible chance", expected="more than 0 and at most 100 %")
    if fault.moment is not None and not 0 <= fault.moment <= LONGEST:
        raise RequestError(
            f"fault {fault}: impossible moment", expected="seconds from the beginning, a year of them at most"
        )
    if (fault.byte is not None or fault.per_byte) and not fault.word.byte:
        raise RequestError(f"fault {fault}: {fault.action} is for a whole packet", expected="no byte")
    if fault.action == "echo" and fault.to is not Side.DEVICE:
        raise RequestError(f"fault {fault}: only what goes to the device can come back as an echo")


def _check_what(fault: Fault) -> None:
    takes = fault.word.takes
    possible = _VALUES.get(takes)
    chance = fault.value == ANY and takes in _BY_CHANCE and fault.byte is None
    if possible is not None and fault.value not in possible and not chance:
        raise RequestError(f"fault {fault}: impossible value", expected=takes.value)
    spans = (fault.seconds, fault.until)
    if not all(0 <= seconds <= LONGEST for seconds in spans) or (takes in _TIMED and not fault.seconds):
        raise RequestError(f"fault {fault}: impossible {fault.action}", expected=takes.value)
    if fault.until and (takes is not Takes.SPAN or fault.until <= fault.seconds):
        raise RequestError(f"fault {fault}: impossible span", expected="the lower one first, as 0.02-0.5")
    if takes is Takes.NODE and fault.node is None:
        raise RequestError(f"fault {fault.action} needs a device", expected=takes.value)


def number(value: float) -> str:
    """A number as short as it can be and still the same."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _where(fault: Fault) -> str:
    if fault.moment is not None:
        return f"at {number(fault.moment)} s"
    if fault.percent:
        return f"{number(fault.percent)}%{' of bytes' if fault.per_byte else ''}"
    if fault.byte is not None:
        return f"exchange {fault.exchange} byte {fault.byte}"
    return f"exchange {fault.exchange}{f' packet {fault.packet}' if fault.packet > 1 else ''}"


def _nothing(fault: Fault) -> str:
    return ""


def _hex(fault: Fault) -> str:
    return "" if fault.value == ANY else f" {fault.value:02X}"


def _bit(fault: Fault) -> str:
    return "" if fault.value == ANY else f" {fault.value}"


def _seconds(fault: Fault) -> str:
    until = f"-{number(fault.until)}" if fault.until else ""
    return f" {number(fault.seconds)}{until}" if fault.seconds or until else ""


def _node(fault: Fault) -> str:
    return " all" if fault.node is None else f" {fault.node}"


_ARGUMENTS: Final[Mapping[Takes, Callable[[Fault], str]]] = MappingProxyType(
    {
        Takes.BITS: _hex,
        Takes.BIT: _bit,
        Takes.BYTE: _hex,
        Takes.SECONDS: _seconds,
        Takes.SPAN: _seconds,
        Takes.PERHAPS_SECONDS: _seconds,
        Takes.PERHAPS_COUNT: lambda fault: f" {fault.value}" if fault.value else "",
        Takes.NODE: _node,
        Takes.NODES: _node,
        Takes.SECONDS_NODE: lambda fault: _seconds(fault) + ("" if fault.node is None else _node(fault)),
    }
)
