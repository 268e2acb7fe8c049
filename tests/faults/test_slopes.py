"""Nothing piles up: ten thousand unplugs in memory, thousands on real ports; descriptors, threads, memory stay level.

What the first cycles leave behind (caches, modules, arenas) is not counted; after those there must be no slope.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import closing

import pytest

import motorbus
from motorbus.errors import LinkLost
from motorbus.families.feetech import FAMILY
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from tests.conftest import Figures, Rounds
from tests.faults.life import FAMILIES, Footprint, Life, footprint
from tests.support.mounts import served

pytestmark = pytest.mark.soak

FULL = 10_000
BLOCKS = 2_000
"""Blocks of Python's memory that may come and go; one that is lost in each cycle would be more than that."""
KIB = 1024
ASKED = 20
"""How often somebody who must be there is asked."""


def slope(warm: Callable[[int], None], cycles: int) -> tuple[Footprint, Footprint]:
    """What the process holds after a third of the cycles, and after all of them."""
    first = max(2, cycles // 3)
    for number in range(first):
        warm(number)
    before = footprint()
    for number in range(first, cycles):
        warm(number)
    return before, footprint()


def level(before: Footprint, after: Footprint) -> bool:
    """Whether nothing has piled up between the two."""
    same = after.descriptors <= before.descriptors and after.threads <= before.threads
    return same and after.blocks - before.blocks <= BLOCKS and after.kib - before.kib <= KIB


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("how", ["found again", "opened anew"])
@pytest.mark.parametrize("family", FAMILIES)
def test_unplugs_leave_nothing_behind(family: str, how: str, rounds: Rounds, figures: Figures) -> None:
    cycles = rounds(FULL, 45)
    with closing(Life(family)) as life:

        def cycle(number: int) -> None:
            life.unplug()
            if how == "opened anew":
                life.reopen()

        before, after = slope(cycle, cycles)
        assert life.counts["unplugged"] == cycles
    assert level(before, after), (before, after)
    figures(
        f"L12 unplugs in memory, {how}",
        family=family,
        cycles=cycles,
        descriptors=after.descriptors - before.descriptors,
        threads=after.threads - before.threads,
        blocks=after.blocks - before.blocks,
        kib=after.kib - before.kib,
    )


def plugged_and_pulled(number: int) -> None:
    """A port of its own that comes, is opened and read, and is pulled while it is open."""
    master = PtyMaster()
    try:
        with served(Mount(FAMILY.simulator((1, 2)), master)):
            bus = motorbus.open(f"feetech:{master.slave_name}")
            servo = motorbus.feetech.Servo(bus, 1 + number % 2)
            assert any(servo.ping() for _ in range(ASKED)), "at once, unless this computer is very busy"
    finally:
        master.close()
    try:
        with pytest.raises(LinkLost):
            bus.run(FAMILY.probe(1, 0))
    finally:
        bus.close()


@pytest.mark.timeout(1800)
def test_real_ports_that_come_and_go_leave_nothing_behind(
    rounds: Rounds,
    figures: Figures,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
    cycles = rounds(5_000, 6)
    before, after = slope(plugged_and_pulled, cycles)
    assert level(before, after), (before, after)
    figures(
        "L12 pseudo-terminals pulled while open",
        family="feetech",
        cycles=cycles,
        descriptors=after.descriptors - before.descriptors,
        threads=after.threads - before.threads,
        kib=after.kib - before.kib,
    )


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("family", FAMILIES)
def test_event_loops_that_come_and_go_leave_no_task(family: str, rounds: Rounds, figures: Figures) -> None:
    cycles = rounds(1_000, 15)
    with closing(Life(family)) as life:
        before, after = slope(lambda number: life.awaited(), cycles)
        assert life.counts["tasks"] == cycles
    assert level(before, after), (before, after)
    with pytest.raises(RuntimeError):
        asyncio.get_running_loop()
    figures(
        "Tasks of event loops that end", family=family, cycles=cycles, threads=after.threads - before.threads
    )
