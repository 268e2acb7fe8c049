"""The floor: what the same exchange costs in Python with nothing around it.

It checks nothing, waits for exactly the bytes it expects, and would hang on a silent servo; no library can be
that careless, so none can be that cheap.
"""

from __future__ import annotations

import os
import select
import struct
import termios
import tty
from typing import Any

from bench.loop import main
from bench.workloads import SIZES, Workload

GOAL, POSITION = 42, 56
ONE = 8
"""Length of a status packet with two bytes of data."""


def packet(node: int, instruction: int, parameters: bytes) -> bytes:
    """One instruction packet."""
    body = bytes((node, len(parameters) + 2, instruction)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 255,))


class Bare:
    """`os.write`, `poll`, `os.read`."""

    def __init__(self, port: str, workload: Workload) -> None:
        self.descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.descriptor, termios.TCSANOW)
        self.poll = select.poll()
        self.poll.register(self.descriptor, select.POLLIN)
        self.nodes = workload.reads or workload.writes
        size = SIZES[workload.what]
        self.read_one = packet(1, 2, bytes((POSITION, 2)))
        self.read_all = packet(254, 0x82, bytes((POSITION, size, *self.nodes)))
        self.length = len(self.nodes) * (6 + size)
        self.values = struct.Struct("<" + ("5xHx" if size == 2 else f"5x{size}sx") * len(self.nodes))

    def read(self, prepared: Any) -> bytes:
        os.write(self.descriptor, self.read_one)
        self.poll.poll(1000)
        answer = os.read(self.descriptor, 4096)
        while len(answer) < ONE:
            answer += os.read(self.descriptor, 4096)
        return answer[5:7]

    def sync_read(self, prepared: Any) -> tuple[Any, ...]:
        os.write(self.descriptor, self.read_all)
        self.poll.poll(1000)
        answer = os.read(self.descriptor, 4096)
        while len(answer) < self.length:
            answer += os.read(self.descriptor, 4096)
        return self.values.unpack(answer)

    blocks = sync_read

    def sync_write(self, prepared: list[int]) -> None:
        data = [
            byte for node, goal in zip(self.nodes, prepared, strict=True) for byte in _six_bytes(node, goal)
        ]
        os.write(self.descriptor, packet(254, 0x83, bytes((GOAL, 6, *data))))

    def cycle(self, prepared: list[int]) -> tuple[int, ...]:
        data = [
            byte
            for node, goal in zip(self.nodes, prepared, strict=True)
            for byte in (node, goal & 255, goal >> 8)
        ]
        os.write(self.descriptor, packet(254, 0x83, bytes((GOAL, 2, *data))))
        return self.sync_read(None)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: bytes | tuple[Any, ...]) -> tuple[Any, ...]:
        return (int.from_bytes(values, "little"),) if isinstance(values, bytes) else values

    def close(self) -> None:
        os.close(self.descriptor)


def _six_bytes(node: int, goal: int) -> tuple[int, ...]:
    """Goal position, no time, 1000 counts/s, as one servo's share of a SYNC WRITE."""
    return node, goal & 255, goal >> 8, 0, 0, 0xE8, 0x03


if __name__ == "__main__":
    main(Bare)
