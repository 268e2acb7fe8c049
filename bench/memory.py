"""The same servos without a kernel: answers made beforehand, handed over inside the process.

What is left of an exchange is what the library itself does. The readings follow the same rule as on the wire, so
the values are checked here too.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle

from bench.workloads import IDS, SIZES, THERE_AND_BACK, Workload, block, named, parts

PORT = "memory"
"""What a contender gets as its port when it shall use this."""

PING, READ, WRITE, SYNC_READ = 1, 2, 3, 0x82
POSITION = 56
MEMORY = bytes((3, 10, 0, 9, 3, 1, 0, 0, 1, 0, 0, 0xFF, 0x0F, 0, 0, 0, 0, 0, 12)).ljust(256, b"\0")
"""Registers of any servo, position left out: firmware 3.10, STS3215, answers everything, limits 0 to 4095, velocities
in counts/s."""
ANSWERS = 120_000
"""Answers that are made beforehand at most: more would only take time. More readings than that raise."""


def packet(node: int, code: int, parameters: bytes = b"") -> bytes:
    """An instruction packet, or a status packet: they are built alike."""
    body = bytes((node, len(parameters) + 2, code)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 255,))


def _turns(nodes: tuple[int, ...]) -> int:
    return min(THERE_AND_BACK, ANSWERS // len(nodes))


def _counter(nodes: tuple[int, ...]) -> Iterator[int]:
    """Readings from 0 on; as long as all of them are known they begin anew."""
    turns = range(_turns(nodes))
    return cycle(turns) if len(turns) == THERE_AND_BACK else iter(turns)


def _trains(nodes: tuple[int, ...], count: int) -> list[bytes]:
    """The answers of all these, `count` bytes each, one train for every turn of the readings."""
    return [
        b"".join(packet(node, 0, block(node, turn)[:count].ljust(count, b"\0")) for node in nodes)
        for turn in range(_turns(nodes))
    ]


class Wire:
    """Gives the answer to a request at once; nothing for a request that nobody answers.

    A library may read a byte more than it needs; the readings go on in either form. Answers are made when they are
    asked for the first time, before the clock runs.
    """

    def __init__(self, workload: Workload | None = None) -> None:
        workload = workload or named("sync-read-6x2")
        self.nodes = workload.nodes
        self._ready: dict[bytes, tuple[Iterator[int], list[bytes]]] = {}
        self._known: dict[bytes, tuple[Iterator[int], tuple[int, ...], int]] = {}
        size = SIZES[workload.what]
        alone = _counter(IDS[:1])
        for count in (2, 3):
            self._known[packet(1, READ, bytes((POSITION, count)))] = alone, IDS[:1], count
        for group in parts(workload.reads):
            together = _counter(group)
            for count in (size, size + 1):
                request = packet(254, SYNC_READ, bytes((POSITION, count, *group)))
                self._known[request] = together, group, count

    def answer(self, request: bytes) -> bytes:
        """The bytes that come back."""
        ready = self._ready.get(request)
        if ready is None:
            return self._seldom(request)
        turns, trains = ready
        return trains[next(turns)]

    def _seldom(self, request: bytes) -> bytes:
        if request in self._known:
            turns, group, count = self._known[request]
            self._ready[request] = turns, _trains(group, count)
            return self.answer(request)
        node, code, end = request[2], request[4], request[3] + 4
        if len(request) > end:  # a write that nobody answers, and a question behind it
            return self.answer(request[end:])
        if node not in self.nodes:
            return b""
        if code == READ:
            registers = MEMORY[:5] + bytes((node,)) + MEMORY[6:]
            return packet(node, 0, registers[request[5] : request[5] + request[6]])
        return packet(node, 0) if code in (PING, WRITE) else b""
