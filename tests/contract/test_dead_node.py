"""A dead servo in a group that is read in a loop: the others stay right and fast, and it returns when it is back."""

from __future__ import annotations

import math
from typing import Any, Final

import pytest

import motorbus
from motorbus import feetech
from tests.conftest import Rounds
from tests.support.machines import machine

IDS: Final = (1, 2, 3, 4, 5, 6)
DEAD: Final = 4
TIMEOUT: Final = 0.03
"""s that a group with a silent member takes at most: its time-out, and not a probe of the silent one each time."""
BACK_OFF: Final = 1.0
"""s after which a servo that is back is asked again."""

LOOP_ENDS: Final = 0.3
"""s without a position of an axis after which a control loop ends."""


def turn(sim: Any, index: int) -> dict[int, float]:
    """Give each servo a new position; return them (rad)."""
    for node in IDS:
        sim[node].raw_position = 100 + (index * 7 + node * 31) % 900
    return {node: (100 + (index * 7 + node * 31) % 900) * math.tau / 4096 for node in IDS}


def test_a_group_read_in_a_loop(rounds: Rounds) -> None:
    cycles = rounds(20_000, 300)
    with motorbus.simulate("feetech", ids=IDS) as sim:
        sim.pace = True
        with motorbus.open(sim.url) as bus:
            servos = [feetech.Servo(bus, node) for node in IDS]
            for servo in servos:
                servo.prepare()

            def read(index: int) -> set[int]:
                right = turn(sim, index)
                found = bus.run(feetech.ServoGroup(servos).positions)
                assert all(abs(right[node] - value) < 1e-3 for node, value in found.values.items()), index
                assert set(found.values) | set(found.missing) == set(IDS)
                return set(found.missing)

            assert read(0) == set()
            sim[DEAD].unplug()
            begun, trace = sim.now, bus.trace.subscribe(10 * cycles)
            for index in range(cycles):
                assert read(index) == {DEAD}
            requests = sum(record.direction == "tx" for record in trace)
            assert sim.now - begun < TIMEOUT * cycles
            assert requests < 1.1 * cycles + 5
            sim[DEAD].plug()
            back = sim.now
            while read(cycles):
                assert sim.now - back < BACK_OFF + TIMEOUT


@pytest.mark.parametrize("silence", [0.05, 0.1, 0.2])
def test_a_servo_that_was_silent_for_a_moment_is_asked_again_before_a_control_loop_gives_up(
    silence: float,
) -> None:
    with motorbus.simulate("feetech", ids=IDS) as sim, motorbus.open(sim.url) as bus:
        sim.pace = True
        servos = [feetech.Servo(bus, node) for node in IDS]
        for servo in servos:
            servo.prepare()
        group = feetech.ServoGroup(servos)
        assert not bus.run(group.positions).missing
        sim[DEAD].unplug()
        begun = sim.now
        while sim.now < begun + silence:
            assert bus.run(group.positions).missing == (DEAD,)
        sim[DEAD].plug()
        while bus.run(group.positions).missing:
            assert sim.now < begun + LOOP_ENDS


def test_a_control_loop_survives_a_gap() -> None:
    """A servo is silent for a while: the loop runs on, the others are fresh in each cycle, then all are."""
    with machine("1-6", exit="leave") as (config, sims):
        sims["arm"].pace = True
        missing: list[frozenset[str]] = []
        with motorbus.Robot(config) as robot, robot.loop(100) as loop:
            for state in loop:
                missing.append(state.missing)
                if len(missing) == 50:
                    sims["arm"][DEAD].unplug()
                elif len(missing) == 60:
                    sims["arm"][DEAD].plug()
                elif len(missing) == 250:
                    break
    silent = [names for names in missing if names]
    assert 9 <= len(silent) <= 20
    assert all(names == {f"a{DEAD}"} for names in silent)
    assert not missing[-1]
