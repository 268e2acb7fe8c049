"""The measured loop on CAN: it runs inside the process of one contender and prints one line of JSON.

Readings are kept while the clock runs and judged afterwards, those of warming up as well: each node is elsewhere, and
elsewhere each time it is read, so an answer of another node, an old one and one that is missing all show.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from resource import RUSAGE_SELF, getrusage
from time import perf_counter
from typing import Any, Protocol

BITRATE = 500_000
POSITION = 0x6002
FIRST = 0x21
REACH, APART = 900, 377
"""The farthest from the middle that a servo is turned, in raw counts; and how far a servo is from the next."""
WARM_UP = 100


def position(node: int, readings: int) -> int:
    """Where a servo is when it is read after so many readings: to and fro over the whole of its range."""
    at = (APART * node + readings) % (4 * REACH)
    return at - REACH if at <= 2 * REACH else 3 * REACH - at


class Reader(Protocol):
    """One library. `read` gives, for each node it was made with, so many positions in raw counts."""

    def read(self, count: int) -> list[list[int]]: ...
    def close(self) -> None: ...


class WrongValue(Exception):
    """A contender returned something else than what the servos said, or too little."""


def measure(reader: Reader, nodes: int, count: int) -> dict[str, Any]:
    """Seconds per position, of the processor and of the wall. Raises WrongValue."""
    warm, each = WARM_UP // nodes, count // nodes
    first = reader.read(warm)
    before, began = getrusage(RUSAGE_SELF), perf_counter()
    values = reader.read(each)
    ended, after = perf_counter(), getrusage(RUSAGE_SELF)
    _check([one + two for one, two in zip(first, values, strict=True)], nodes, warm + each)
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {"processor": used / (each * nodes), "wall": (ended - began) / (each * nodes)}


def _check(values: list[list[int]], nodes: int, each: int) -> None:
    if len(values) != nodes:
        raise WrongValue(f"positions of {len(values)} nodes instead of {nodes}")
    for node, found in enumerate(values, start=FIRST):
        due = [position(node, number) for number in range(each)]
        for number, pair in enumerate(zip(found, due, strict=False)):
            if pair[0] != pair[1]:
                raise WrongValue(f"node {node:#x}: number {number} is {pair[0]}, not {pair[1]}")
        if len(found) != each:
            raise WrongValue(f"node {node:#x}: {len(found)} positions of {each}")


def main(make: Callable[[str, tuple[int, ...]], Reader]) -> None:
    """`python -m bench.contenders.NAME PORT NODES COUNT`."""
    parser = argparse.ArgumentParser()
    parser.add_argument("port")
    parser.add_argument("nodes", type=int)
    parser.add_argument("count", type=int)
    given = parser.parse_args()
    reader = make(given.port, tuple(range(FIRST, FIRST + given.nodes)))
    try:
        found = measure(reader, given.nodes, given.count)
    finally:
        reader.close()
    json.dump(found, sys.stdout)
