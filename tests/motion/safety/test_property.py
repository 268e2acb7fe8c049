"""Whatever anybody calls, no bytes order a place outside the limits or too far from where the device is.

And whatever is allowed does reach the bus. Bytes are judged by decoders that know the manuals and not the drivers.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import pytest

from motorbus.session.robot import Robot
from tests.motion.machines import machine
from tests.motion.safety.calls import AXES, Caller, drawn

CALLS = 2_000
"""Of one seed; after so many a new machine is opened."""


@pytest.mark.timeout(0)
def test_nothing_outside_the_limits_reaches_a_bus_and_all_that_is_allowed_does(
    rounds: Callable[[int], int],
) -> None:
    left = rounds(1_000_000)
    for seed in count():
        if left <= 0:
            return
        tally = run(seed, min(left, CALLS))
        left -= CALLS
        print(f"seed {seed}: {tally}")


def run(seed: int, calls: int) -> str:
    """So many calls of this seed."""
    with machine(arm="1-2", can="0x25,0x26", axes=AXES) as (made, sims), Robot.of(made) as robot:
        caller = Caller(robot, sims, seed)
        for name, wire in caller.wires.items():
            sims[name].line = wire
        robot.positions()
        for call in drawn(caller, calls):
            caller.make(call)
        assert caller.tally.passed > calls / 20
        assert caller.tally.refused > calls / 20
        return str(caller.tally)
