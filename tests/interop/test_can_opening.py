"""How long it takes to open and to close a CAN bus, by every way there is on a machine without CAN.

python-can's own slcan waits two seconds when it opens; a program that does one thing and ends must not. These are
figures of the machine at hand, so they are printed by the long runs and judged by whoever reads them; what a test
judges is that each of many buses opened in a row answers, and leaves the port to the next.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from statistics import median

import pytest

import motorbus
from motorbus import kst
from tests.support.processes import Simulated

ROUNDS = 50


@contextmanager
def by_port(place: int, folder: Path) -> Iterator[str]:
    with Simulated("kst", ids="0x25", link=folder / "can", tcp="0") as simulated:
        yield simulated.buses[place]


@contextmanager
def by_virtual(folder: Path) -> Iterator[str]:
    with motorbus.simulate("kst", ids="0x25") as sim, sim.serve("can://virtual/opening"):
        yield "kst:can://virtual/opening"


WAYS: dict[str, Callable[[Path], AbstractContextManager[str]]] = {
    "slcan on a pseudo-terminal": lambda folder: by_port(0, folder),
    "slcan on TCP": lambda folder: by_port(1, folder),
    "virtual": by_virtual,
}


def timed(bus: str) -> tuple[float, float]:
    """Open, read once, close: how long the first and the last took (s)."""
    begun = time.perf_counter()
    opened = motorbus.open(bus)
    open_time = time.perf_counter() - begun
    try:
        assert kst.Servo(opened, 0x25).node_id() == 0x25
    finally:
        begun = time.perf_counter()
        opened.close()
    return open_time, time.perf_counter() - begun


@pytest.mark.soak
@pytest.mark.parametrize("way", WAYS)
def test_how_long_opening_and_closing_take(way: str, tmp_path: Path) -> None:
    with WAYS[way](tmp_path) as bus:
        timed(bus)  # python-can is loaded now
        times = [timed(bus) for _ in range(ROUNDS)]
    opening, closing = (median(column) for column in zip(*times, strict=True))
    print(f"\n{way}: opens in {1000 * opening:.1f} ms, closes in {1000 * closing:.1f} ms")
