"""Ctrl-C once more while the first one is dealt with, on the straight way of an event loop: the bus is let go of."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest

from motorbus import feetech
from tests.bus.test_glide import is_free, kept, there
from tests.conftest import Figures, Rounds
from tests.faults.cutting import NEVER, Outcome, Twice, cut, places

STEP = math.tau / 4096
LATER = 40
"""Lines after the first interrupt in which the second one falls: by then the first has been dealt with."""


def left(bus: Any, servo: feetech.AsyncServo) -> None:
    """The request leaves, and whoever awaits its answer is cancelled."""
    coroutine = bus.run(kept(servo))
    try:
        coroutine.send(None)
        coroutine.throw(asyncio.CancelledError())
    finally:
        coroutine.close()


async def cut_twice(far: Any, bus: Any, servo: feetech.AsyncServo, at: int, later: int) -> Outcome:
    """Cut there and so many lines later; then the lock is free, and what is read is where it is now."""
    came = cut(lambda: left(bus, servo), at, KeyboardInterrupt, later, Twice)
    where = came.where, came.again
    assert came.where is None or isinstance(came.error, KeyboardInterrupt), (where, came.error)
    assert is_free(bus), f"the lock is held, cut at {where}"
    place = 1000 + at * 37 % 500 + later
    far.simulator.nodes[1].raw_position = place
    assert await servo.position() == place * STEP, where
    assert bus.turns.idle, where
    return came


@pytest.mark.timeout(1800)
def test_l17_a_second_interrupt_while_the_first_is_dealt_with_on_the_straight_way_of_a_loop(
    rounds: Rounds, figures: Figures
) -> None:
    counts = {"cuts": 0, "twice": 0}
    most = rounds(NEVER, 10)

    async def main() -> None:
        async with there() as (far, bus, servo):
            await servo.position()
            whole = cut(lambda: left(bus, servo))
            assert isinstance(whole.error, asyncio.CancelledError)
            await servo.position()
            for number, at in enumerate(places(whole.walked, 1, most)):
                some = (1 + number * 7 % 5, 3 + number * 11 % 17)
                for later in range(1, LATER) if most == NEVER else some:
                    came = await cut_twice(far, bus, servo, at, later)
                    counts["cuts"] += came.where is not None
                    counts["twice"] += came.again is not None

    asyncio.run(main())
    figures(
        "L17 interrupted twice: a read on an event loop, the straight way",
        family="feetech",
        **counts,
    )
    assert counts["cuts"] >= min(most, 20)
    assert counts["twice"] >= counts["cuts"] / 4
