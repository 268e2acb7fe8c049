"""The same traffic as `bench.robot_loop` by system calls alone: what this machine lets anybody achieve on that line.

    python -m bench.bare_loop [--seconds 10]

No library, no check, no goal worked out: constant bytes are written, and as many are read as must come. What is lost
here is lost to the system and its terminals, so a loop is best compared with this in the same run.
"""

from __future__ import annotations

import argparse
import os
import sys
import tty
from select import select
from time import monotonic
from typing import NamedTuple

from bench.responder import build, responder
from bench.workloads import IDS
from motorbus.families.feetech import wire

BAUD = 1_000_000
GOAL, PRESENT, SIZE = 42, 56, 2
BITS = 10
PATIENCE = 10.0


class Bare(NamedTuple):
    """Cycles per second that were asked for (0: as many as can be) and achieved, how many, how many were not over when
    the next was due, and how long one took: median and 99th percentile (s)."""

    asked: float
    achieved: float
    cycles: int
    overruns: int
    median: float
    most: float


def bare(rate: float, seconds: float) -> Bare:
    """Cycles for so long (s), on a fixed grid of `rate` (Hz) or, with 0, one after the other. Raises NoCompiler."""
    request = wire.sync_write(GOAL, [(node, b"\0\x08") for node in IDS]) + wire.sync_read(
        PRESENT, SIZE, list(IDS)
    )
    due = len(IDS) * (wire.OVERHEAD + SIZE)
    with responder(build(), BAUD) as line:
        port = os.open(line.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(port)
            return _cycled(port, request, due, rate, seconds)
        finally:
            os.close(port)


def _cycled(port: int, request: bytes, due: int, rate: float, seconds: float) -> Bare:
    took: list[float] = []
    overruns = 0
    began = slot = monotonic()
    while (now := monotonic()) - began < seconds:
        while rate and now < slot:
            now = monotonic()
        _exchange(port, request, due)
        ended = monotonic()
        took.append(ended - now)
        if rate:
            slot += 1 / rate
            overruns += ended > slot
            slot = max(slot, ended)
    lasted = monotonic() - began
    took.sort()
    count = len(took)
    return Bare(rate, count / lasted, count, overruns, took[count // 2], took[count * 99 // 100])


def _exchange(port: int, request: bytes, due: int) -> None:
    os.write(port, request)
    came = 0
    while came < due:
        if not select((port,), (), (), PATIENCE)[0]:
            raise TimeoutError(f"{came} of {due} bytes came")
        came += len(os.read(port, 4096))


def told(found: Bare, wire_rate: float) -> str:
    """One line for people."""
    how = f"at {found.asked:.1f} Hz" if found.asked else "flat out"
    return (
        f"bare system calls, {how}: {found.achieved:.1f} cycles/s, {found.achieved / wire_rate:.1%} of the wire's, "
        f"{found.overruns} overruns in {found.cycles}; a cycle took {found.median * 1e6:.0f} µs, "
        f"99 % of them at most {found.most * 1e6:.0f} µs"
    )


def main() -> int:
    """Both ways, and what came of them."""
    parser = argparse.ArgumentParser(prog="python -m bench.bare_loop", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    air = BITS * (8 + 3 * len(IDS) + 8 + len(IDS) + len(IDS) * (wire.OVERHEAD + SIZE)) / BAUD
    for rate in (0.0, 0.8 / air):
        print(told(bare(rate, seconds), 1 / air))
    return 0


if __name__ == "__main__":
    sys.exit(main())
