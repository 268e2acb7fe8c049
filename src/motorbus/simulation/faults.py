"""A wire that does harm by script: this byte of that exchange, this way, and a record that it happened.

Faults by chance (`link.memory.NoisyLine`) find what nobody thought of; faults by script prove that nothing was
forgotten, one byte after the other. A script is text, so a failing case can be printed, kept and run again:

    exchange 17 byte 3: drop
    exchange 17 byte 0 to device: corrupt 80
    exchange 18 byte 8: delay 0.02

It stands between a simulator and whatever serves it. There is no way to put it in front of a real device.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Final

from motorbus.core.operation import CanFrame, Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Side
from motorbus.link.memory import Fired

_TAKES: Final = {
    "drop": "",
    "duplicate": "",
    "truncate": "",
    "corrupt": "the bits to turn over, in hex, 01 to FF",
    "insert": "the byte in front, in hex, 00 to FF",
    "delay": "seconds, more than 0",
}
_FAULT: Final = re.compile(
    r"(?:at\s+)?exchange\s+(?P<exchange>\d+)\s+byte\s+(?P<byte>\d+)(?:\s+to\s+(?P<to>host|device))?\s*:"
    r"\s*(?P<action>[a-z]+)(?:\s+(?P<argument>\S+))?",
    re.ASCII,
)


@dataclass(frozen=True, slots=True)
class Fault:
    """One harm. Raises RequestError when it is impossible or would change nothing.

    `exchange`  1 is the first thing the host sends, the next thing it sends begins exchange 2
    `byte`      counted from 0 in the direction `to` within the exchange; `insert` may stand behind the last one
    `action`    drop, duplicate, corrupt (turn over the bits of `value`), insert (`value` in front), delay (this byte
                and all that follow in this exchange come `seconds` later), truncate (this byte and all that follow in
                this exchange are lost)
    """

    exchange: int
    byte: int
    action: str
    to: Side = Side.HOST
    value: int = 0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        if self.action not in _TAKES:
            raise RequestError(f"fault {self.action!r} is not known", expected=f"one of {', '.join(_TAKES)}")
        if self.exchange < 1 or self.byte < 0:
            raise RequestError(f"fault {self}: exchanges count from 1 and bytes from 0")
        least = {"corrupt": 1, "insert": 0}.get(self.action)
        if least is not None and not least <= self.value <= 255:
            raise RequestError(f"fault {self}: impossible value", expected=_TAKES[self.action])
        if self.action == "delay" and not (isfinite(self.seconds) and self.seconds > 0):
            raise RequestError(f"fault {self}: impossible delay", expected=_TAKES["delay"])

    def __str__(self) -> str:
        argument = {
            "corrupt": f" {self.value:02X}",
            "insert": f" {self.value:02X}",
            "delay": f" {self.seconds:g}",
        }
        where = f"exchange {self.exchange} byte {self.byte}{' to device' if self.to is Side.DEVICE else ''}"
        return f"{where}: {self.action}{argument.get(self.action, '')}"


def parse(text: str) -> list[Fault]:
    """A script: one fault a line or between semicolons, `#` begins a remark. Raises RequestError with the line."""
    lines = (part.partition("#")[0].strip() for part in re.split(r"[\n;]", text))
    return [_fault(line) for line in lines if line]


def _fault(line: str) -> Fault:
    match = _FAULT.fullmatch(line)
    if match is None:
        raise RequestError(
            f"{line!r} is not a fault",
            expected="for example `exchange 17 byte 3: drop` or `… to device: corrupt 80`",
        )
    action, argument = match["action"], match["argument"]
    takes = _TAKES.get(action, "")
    if bool(takes) != (argument is not None):
        raise RequestError(f"fault {line!r}: {action} takes {takes or 'nothing more'}")
    try:
        seconds = float(argument) if action == "delay" else 0.0
        value = int(argument, 16) if takes and action != "delay" else 0
    except ValueError:
        raise RequestError(f"fault {line!r}: impossible {argument!r}", expected=takes) from None
    to = Side.DEVICE if match["to"] == "device" else Side.HOST
    return Fault(int(match["exchange"]), int(match["byte"]), action, to, value, seconds)


class ScriptedLine:
    """A `Line` that carries, and does harm where its script says so.

    `fired` lists what has happened, in order, each with the fault as text; `pending` what has not. A CAN frame is
    carried unharmed. The same script and the same traffic give the same bytes at the same moments.
    """

    def __init__(self, script: str | Iterable[Fault]) -> None:
        self.faults = tuple(parse(script) if isinstance(script, str) else script)
        self.fired: list[Fired] = []
        self.exchange = 0
        self._waiting: dict[int, list[Fault]] = {}
        for fault in self.faults:
            self._waiting.setdefault(fault.exchange, []).append(fault)
        self._passed = {Side.HOST: 0, Side.DEVICE: 0}
        self._later = {Side.HOST: 0.0, Side.DEVICE: 0.0}
        self._lost: set[Side] = set()

    def __str__(self) -> str:
        return "\n".join(map(str, self.faults))

    @property
    def pending(self) -> tuple[Fault, ...]:
        """The faults that have not happened yet."""
        return tuple(fault for waiting in self._waiting.values() for fault in waiting)

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        """What arrives of this, and when."""
        if sender is Side.HOST:
            self._next_exchange()
        to = Side.DEVICE if sender is Side.HOST else Side.HOST
        quiet = not (self._waiting.get(self.exchange) or self._lost or self._later[to])
        if isinstance(data, CanFrame) or quiet:
            return [Delivery(at, to, data)]
        pieces = [Delivery(at + later, to, piece) for later, piece in self._pieces(to, data, at) if piece]
        self._passed[to] += len(data)
        return pieces

    def _next_exchange(self) -> None:
        self.exchange += 1
        self._passed = dict.fromkeys(Side, 0)
        self._later = dict.fromkeys(Side, 0.0)
        self._lost.clear()

    def _pieces(self, to: Side, data: bytes, at: float) -> Iterator[tuple[float, bytes]]:
        """Runs of bytes with one delay each."""
        piece = b""
        for place in range(len(data) + 1):
            byte = data[place : place + 1]
            for fault in self._due(to, self._passed[to] + place, behind=not byte):
                self._fire(fault, data, at)
                if fault.action == "delay":
                    yield self._later[to], piece
                    piece = b""
                    self._later[to] += fault.seconds
                elif fault.action == "truncate":
                    self._lost.add(to)
                else:
                    byte = _harmed(fault, byte)
            piece += b"" if to in self._lost else byte
        yield self._later[to], piece

    def _due(self, to: Side, byte: int, *, behind: bool) -> list[Fault]:
        return [
            fault
            for fault in self._waiting.get(self.exchange, ())
            if (fault.to, fault.byte) == (to, byte) and (not behind or fault.action == "insert")
        ]

    def _fire(self, fault: Fault, data: bytes, at: float) -> None:
        self._waiting[self.exchange].remove(fault)
        self.fired.append(Fired(at, str(fault), fault.to, data))


def _harmed(fault: Fault, byte: bytes) -> bytes:
    if fault.action == "corrupt":
        return bytes([byte[0] ^ fault.value]) + byte[1:] if byte else byte
    if fault.action == "insert":
        return bytes([fault.value]) + byte
    return byte * 2 if fault.action == "duplicate" else b""
