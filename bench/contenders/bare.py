"""The floor: the same bytes by plain system calls, without any check."""

from __future__ import annotations

import os
import select
import struct
import tty
from typing import Any

from bench.measure import Contender, main
from bench.workloads import NODES, packet


class Bare(Contender):
    """`os.write`, `poll`, `os.read`."""

    def __init__(self, port: str) -> None:
        self.descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.descriptor)
        self.poll = select.poll()
        self.poll.register(self.descriptor, select.POLLIN)
        self.one = packet(1, 2, bytes((56, 2)))
        self.all = packet(254, 0x82, bytes((56, 2, *NODES)))
        self.values = struct.Struct("<" + "5xHx" * len(NODES))

    def _ask(self, request: bytes, length: int) -> bytes:
        os.write(self.descriptor, request)
        answer = b""
        while len(answer) < length:
            if not self.poll.poll(100):
                raise TimeoutError
            answer += os.read(self.descriptor, 4096)
        return answer

    def read(self) -> int:
        return int.from_bytes(self._ask(self.one, 8)[5:7], "little")

    def read_group(self) -> Any:
        return self.values.unpack(self._ask(self.all, 8 * len(NODES)))

    def write_group(self, goals: list[int]) -> None:
        rows = b"".join(
            bytes((node,)) + struct.pack("<H", goal) for node, goal in zip(NODES, goals, strict=True)
        )
        os.write(self.descriptor, packet(254, 0x83, bytes((42, 2)) + rows))


if __name__ == "__main__":
    main(Bare)
