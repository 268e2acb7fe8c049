"""Whatever anybody calls, no bytes order a place outside the limits or too far from where the device is.

And whatever is allowed does reach the bus. Bytes are judged by decoders that know the manuals and not the drivers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import count

import pytest

from motorbus.session.robot import Robot
from tests.safety.calls import AXES, Tally, drawn
from tests.safety.courses import POSES
from tests.safety.matters import Matters
from tests.support.machines import machine

CALLS = 2_000
"""Of one seed; after so many a new machine is opened."""
MANY = 10_000
"""Calls in which every kind was drawn."""
LED = ("robot.move", "axis.move", "robot.replay", "axis.jog")
ORDERS = (
    "move",
    "write",
    "reg_write",
    "sync_write",
    "ServoGroup.write",
    "broadcast",
    "two",
    "raw",
)
ACTIONS = ("action", "action by another", "action_all", "action_all of those named")
ALWAYS = (
    "robot.pose",
    "robot.jogging",
    "robot.loop",
    "robot.loop direct",
    "robot.follow",
    "reg_write alone",
    "wheel",
)
PASS = (*LED, *ORDERS, *ACTIONS, *ALWAYS, "with the lease")
"""Calls that pass somewhere in a run, and of which every allowed one does."""
REFUSED = (
    *LED[:3],
    *ORDERS,
    *ACTIONS,
    "at fault",
    "without the lease",
    "with the lease",
    "bytes",
    "wheel later",
)
"""Calls that are refused somewhere in a run, as every one is that is not allowed."""


@pytest.mark.timeout(0)
def test_nothing_outside_the_limits_reaches_a_bus_and_all_that_is_allowed_does(
    rounds: Callable[[int], int],
) -> None:
    calls = left = rounds(1_000_000)
    passed: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    for seed in count():
        if left <= 0:
            break
        tally = run(seed, min(left, CALLS))
        left -= CALLS
        passed += tally.passed
        refused += tally.refused
        print(f"seed {seed}: {tally}")
    assert min(passed.total(), refused.total()) > calls / 20
    if calls >= MANY:
        assert [what for what in PASS if not passed[what]] == [], passed
        assert [what for what in REFUSED if not refused[what]] == [], refused


def run(seed: int, calls: int) -> Tally:
    """So many calls of this seed."""
    with (
        machine(arm="1-3", can="0x25,0x26", axes=AXES, extra=POSES) as (made, sims),
        Robot.of(made) as robot,
    ):
        caller = Matters(robot, sims, seed)
        for name, wire in caller.wires.items():
            sims[name].line = wire
        robot.positions()
        for call in drawn(caller, calls):
            caller.make(call)
        return caller.tally
