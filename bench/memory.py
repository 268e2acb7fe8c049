"""The same servos without a kernel: answers made beforehand, handed over inside the process.

What is left of an exchange is what the library itself does. The readings follow the same rule as on the wire, so
the values are checked here too.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle

from bench.workloads import COUNTS, IDS, position

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


def _readings(nodes: tuple[int, ...]) -> Iterator[bytes]:
    return cycle(
        [
            b"".join(packet(node, 0, position(node, turn).to_bytes(2, "little")) for node in nodes)
            for turn in range(COUNTS)
        ]
    )


class Wire:
    """Gives the answer to a request at once; nothing for a request that nobody answers."""

    def __init__(self) -> None:
        self._ready = {
            packet(1, READ, bytes((POSITION, 2))): _readings(IDS[:1]),
            packet(254, SYNC_READ, bytes((POSITION, 2, *IDS))): _readings(IDS),
        }

    def answer(self, request: bytes) -> bytes:
        """The bytes that come back."""
        ready = self._ready.get(request)
        return next(ready) if ready is not None else self._seldom(request)

    def _seldom(self, request: bytes) -> bytes:
        node, code = request[2], request[4]
        if node not in IDS:
            return b""
        if code == READ:
            registers = MEMORY[:5] + bytes((node,)) + MEMORY[6:]
            return packet(node, 0, registers[request[5] : request[5] + request[6]])
        return packet(node, 0) if code in (PING, WRITE) else b""
