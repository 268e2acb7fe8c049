"""A simulated bus for a foreign client, and an own look into the memory of the same servos.

The simulator runs in a process of its own on a pseudo-terminal. The observer has the terminal open as well, and reads
while the client is idle: so a client is judged by what the servo holds.
"""

from __future__ import annotations

import json
import os
import select
import socket
import termios
import tty
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

from motorbus.families.feetech import protocol
from motorbus.families.feetech.registers import TABLES
from tests.support.processes import Simulated

IDS: Final = (1, 2, 253)
ABSENT: Final = 7
RATE: Final = 1_000_000
QUIET: Final = 0.05
"""s without a byte after which the line counts as quiet."""
TIMEOUT: Final = 2.0
TRIES: Final = 5


class Kind(NamedTuple):
    """A servo as the sessions need it: its model, register map, byte order, model number and middle position."""

    model: str
    map: str
    order: str
    number: int
    middle: int

    def word(self, value: int) -> list[int]:
        """The two bytes of a number that is not negative, as this servo has them in its memory."""
        low, high = value & 0xFF, value >> 8
        return [low, high] if self.order == "little" else [high, low]

    def number_of(self, data: list[int]) -> int:
        """The other way round."""
        return data[0] | data[1] << 8 if self.order == "little" else data[0] << 8 | data[1]

    def signed(self, row: str, value: int) -> list[int]:
        """The bytes of a raw value as the row of our table has it."""
        return list(TABLES[self.map][row].encode(value))

    def at(self, row: str) -> int:
        """Its address."""
        return TABLES[self.map][row].address


STS: Final = Kind("sts3215", "sts", "little", 777, 2048)
SCS: Final = Kind("scs0009", "scs", "big", 1284, 512)
HLS: Final = Kind("hls3925", "hls", "little", 3850, 2048)
KINDS: Final = (STS, SCS, HLS)


class Twin:
    """A simulated bus with the servos `IDS` of one kind; of several kinds, one servo each, with more ids from 11 on."""

    def __init__(self, folder: Path, *kinds: Kind) -> None:
        self.kinds = kinds
        self.ids = (*IDS, *range(11, 11 + len(kinds) - len(IDS)))
        self.port = str(folder / "bus")
        self._folder = folder
        self._stack = ExitStack()
        self._parser = protocol.parser(protocol.MAX_ID)

    def __enter__(self) -> Self:
        control = self._folder / "control"
        model = "+".join(kind.model for kind in self.kinds)
        ids = ",".join(map(str, self.ids))
        self._stack.enter_context(
            Simulated("feetech", ids=ids, link=Path(self.port), model=model, control=str(control))
        )
        self._orders = self._stack.enter_context(socket.socket(socket.AF_UNIX))
        self._orders.connect(str(control))
        self._answers = self._stack.enter_context(self._orders.makefile("r"))
        self._terminal = os.open(self.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._stack.callback(os.close, self._terminal)
        tty.setraw(self._terminal)
        return self

    def __exit__(self, *exc: object) -> None:
        self._stack.close()

    def order(self, line: str) -> str:
        """Send one order to the control socket; its answer."""
        self._orders.sendall(f"{line}\n".encode())
        answer = self._answers.readline().strip()
        assert "error" not in json.loads(answer), answer
        return answer

    def status(self) -> dict[int, dict[str, Any]]:
        """How each servo is, by its id."""
        nodes: list[dict[str, Any]] = json.loads(self.order("status"))["nodes"]
        return {node["id"]: node for node in nodes}

    def fresh(self) -> None:
        """Every servo as after power-up with nothing stored, plugged in, and the line quiet at the usual rate."""
        for node, facts in self.status().items():
            if not facts["plugged"]:
                self.order(f"plug {node}")
        self.order("power-cycle")
        self._tune(RATE)
        self.drain(0.0)

    def drain(self, quiet: float = QUIET) -> None:
        """Drop what arrives until nothing has come for this time (s)."""
        while self._bytes(quiet):
            pass

    def read(self, node: int, address: int, count: int) -> list[int]:
        """What this servo holds."""
        rate = self._tune(RATE)
        try:
            return list(self._asked(protocol.read(node, address, count), node, count).parameters)
        finally:
            self._tune(rate)

    def write(self, node: int, address: int, data: list[int]) -> None:
        """Change what it holds, by an ordinary write."""
        self._asked(protocol.write(node, address, bytes(data)), node, 0)

    def alarm(self, node: int) -> int:
        """The error byte of its answer to a PING."""
        return self._asked(protocol.ping(node), node, 0).code

    def _asked(self, packet: bytes, node: int, count: int) -> protocol.Packet:
        """The answer with so many parameters; what a client has left unread is passed over."""
        for _ in range(TRIES):
            self.drain(0.0)
            os.write(self._terminal, packet)
            while data := self._bytes(TIMEOUT):
                for answer, fault in self._parser.feed(data):
                    if not fault and answer[2] == node and len(answer) == protocol.OVERHEAD + count:
                        return protocol.decode(answer)
        raise AssertionError(f"no answer to {packet.hex(' ')}")

    def _bytes(self, timeout: float) -> bytes:
        ready, _, _ = select.select([self._terminal], [], [], timeout)
        return os.read(self._terminal, 4096) if ready else b""

    def _tune(self, rate: int) -> int:
        """Set the line to this rate, in bit/s or as a number of termios; gives the one before as the latter."""
        settings = termios.tcgetattr(self._terminal)
        before: int = settings[4]
        code = getattr(termios, f"B{rate}", rate)
        if before != code:
            settings[4] = settings[5] = code
            termios.tcsetattr(self._terminal, termios.TCSANOW, settings)
        return before
