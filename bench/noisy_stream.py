"""A capture of status packets as a bad line leaves it, and what can be made of it by brute force.

Replies of the lengths that occur: acknowledgements, trains of two bytes from six servos, feedback of fifteen bytes,
settings of forty. One byte in a hundred is damaged, and garbage stands between packets now and then, more often than
not with header bytes in it. Same seed, same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Final

from bench.memory import packet

PACKETS: Final = 20_000
DAMAGED: Final = 0.01
"""Share of the bytes that are changed."""
GARBAGE: Final = 0.02
"""Share of the packets that have garbage behind them."""
LONGEST: Final = 256
"""Bytes of the longest piece in which it arrives."""
LENGTHS: Final = (0, 2, 2, 2, 2, 2, 2, 15, 15, 40)
"""Bytes of data in a reply; one is drawn for each."""
HEADER: Final = 0xFF
TOP: Final = 253


def capture(packets: int = PACKETS, seed: int = 8, damaged: float = DAMAGED) -> bytes:
    """So many replies and what happened to them."""
    lot = Random(seed)
    clean = bytearray()
    for _ in range(packets):
        clean += packet(lot.randrange(1, 31), 0, lot.randbytes(lot.choice(LENGTHS)))
        if lot.random() < GARBAGE:
            clean += bytes(lot.choice((HEADER, lot.randrange(256))) for _ in range(lot.randrange(1, 9)))
    for at in range(len(clean)):
        if lot.random() < damaged:
            clean[at] ^= lot.randrange(1, 256)
    return bytes(clean)


def pieces(stream: bytes, seed: int = 9) -> list[bytes]:
    """The stream, cut by lot as a serial port might hand it over."""
    lot, found, at = Random(seed), [], 0
    while at < len(stream):
        size = lot.randrange(1, LONGEST + 1)
        found.append(stream[at : at + size])
        at += size
    return found


def decodable(stream: bytes) -> Iterator[tuple[int, bytes]]:
    """Every packet that can be found, with its place: each byte is tried as the first, and none belongs to two."""
    at = 0
    while at + 6 <= len(stream):
        size = stream[at + 3] + 4
        body = stream[at + 2 : at + size - 1]
        if (
            stream[at] == stream[at + 1] == HEADER
            and stream[at + 2] <= TOP
            and size >= 6
            and at + size <= len(stream)
            and (~sum(body)) & 0xFF == stream[at + size - 1]
        ):
            yield at, stream[at : at + size]
            at += size
        else:
            at += 1
