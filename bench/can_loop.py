"""The measured loop on CAN: it runs inside the process of one contender and prints one line of JSON."""

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
STANDS = 123
"""Where every simulated servo stands, in raw counts."""
WARM_UP = 100


class Reader(Protocol):
    """One library. `read` gives so many positions of each node it was made with, in raw counts."""

    def read(self, count: int) -> list[int]: ...
    def close(self) -> None: ...


class WrongValue(Exception):
    """A contender returned something else than what the servos said, or too little."""


def measure(reader: Reader, nodes: int, count: int) -> dict[str, Any]:
    """Seconds per position, of the processor and of the wall. Raises WrongValue."""
    reader.read(WARM_UP // nodes)
    each = count // nodes
    before, began = getrusage(RUSAGE_SELF), perf_counter()
    values = reader.read(each)
    ended, after = perf_counter(), getrusage(RUSAGE_SELF)
    if values != [STANDS] * (each * nodes):
        raise WrongValue(f"{len(values)} of {each * nodes} positions, {set(values) - {STANDS}} among them")
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {"processor": used / len(values), "wall": (ended - began) / len(values)}


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
