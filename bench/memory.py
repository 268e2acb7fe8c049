"""The same servos without a kernel: answers made beforehand, handed over inside the process.

What is left of an exchange is what the library itself does. The readings follow the same rule as on the wire, so
the values are checked here too.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle

from bench.workloads import IDS, THERE_AND_BACK, position

PORT = "memory"
"""What a contender gets as its port when it shall use this."""

PING, READ, WRITE, SYNC_READ = 1, 2, 3, 0x82
POSITION = 56
MEMORY = bytes((3, 10, 0, 9, 3, 1, 0, 0, 1, 0, 0, 0xFF, 0x0F)).ljust(256, b"\0")
"""Registers of any servo, position left out: firmware 3.10, STS3215, answers everything, limits 0 to 4095."""


def packet(node: int, code: int, parameters: bytes = b"") -> bytes:
    """An instruction packet, or a status packet: they are built alike."""
    body = bytes((node, len(parameters) + 2, code)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 255,))


def _trains(nodes: tuple[int, ...], count: int) -> list[bytes]:
    """The answers of all these, `count` bytes each, one train for every turn of the readings."""
    return [
        b"".join(
            packet(node, 0, position(node, turn).to_bytes(2, "little").ljust(count, b"\0")) for node in nodes
        )
        for turn in range(THERE_AND_BACK)
    ]


class Wire:
    """Gives the answer to a request at once; nothing for a request that nobody answers.

    A library may read a byte more than it needs; the readings go on in either form.
    """

    def __init__(self) -> None:
        one, all_ = cycle(range(THERE_AND_BACK)), cycle(range(THERE_AND_BACK))
        self._ready: dict[bytes, tuple[Iterator[int], list[bytes]]] = {}
        for count in (2, 3):
            self._ready[packet(1, READ, bytes((POSITION, count)))] = one, _trains(IDS[:1], count)
            self._ready[packet(254, SYNC_READ, bytes((POSITION, count, *IDS)))] = all_, _trains(IDS, count)

    def answer(self, request: bytes) -> bytes:
        """The bytes that come back."""
        ready = self._ready.get(request)
        if ready is None:
            return self._seldom(request)
        turns, trains = ready
        return trains[next(turns)]

    def _seldom(self, request: bytes) -> bytes:
        node, code = request[2], request[4]
        if node not in IDS:
            return b""
        if code == READ:
            registers = MEMORY[:5] + bytes((node,)) + MEMORY[6:]
            return packet(node, 0, registers[request[5] : request[5] + request[6]])
        return packet(node, 0) if code in (PING, WRITE) else b""
