"""The measured exchanges, and what the simulated devices and the measured processes share.

Standard library only: these lines also run beside other libraries.
"""

from __future__ import annotations

import mmap
from pathlib import Path

READ, GROUP_READ, GROUP_WRITE, LATE = "position read", "group read", "group write", "late replies"
NODES = (1, 2, 3, 4, 5, 6)
SPANS = {"feetech": 4000, "kst": 1800}
"""Positions repeat after so many requests."""
LATE_SHARE = 0.01
BITRATE = 500_000


def position(family: str, node: int, received: int) -> int:
    """Position of a simulated servo after `received` reads, in raw counts."""
    at = (377 * node + 7 * received) % SPANS[family]
    return at - 900 if family == "kst" else at


def packet(node: int, code: int, parameters: bytes | bytearray = b"") -> bytes:
    """A FEETECH packet: an instruction, or a status with its error byte."""
    body = bytes((node, len(parameters) + 2, code)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 255,))


class Books:
    """Counters in a file that the device writes and the measured process reads.

    `received`  by node: reads that the device has received
    `goals`  by node: sum of the goals that arrived
    `late`   one number: not 0 if some replies are to be late
    """

    def __init__(self, file: Path) -> None:
        size = 8 * (2 * 256 + 1)
        if not file.exists():
            file.write_bytes(bytes(size))
        with file.open("r+b") as opened:
            counts = memoryview(mmap.mmap(opened.fileno(), size)).cast("q")
        self.received, self.goals, self.late = counts[:256], counts[256:512], counts[512:]
