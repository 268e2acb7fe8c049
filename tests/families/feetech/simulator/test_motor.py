"""Shaft, zero and reading: the arithmetic behind the modes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.plant import Drive, rest
from motorbus.families.feetech.simulator.motor import Settings, plan, reading, step, zero_for
from motorbus.families.feetech.simulator.switches import Switches

DRIVE = Drive(top_speed=3400.0, idle_current=0.15, stall_current=3.25)
SHIPPED = Settings(
    strong=True,
    mode=0,
    goal=0,
    duty=0,
    goal_velocity=0,
    velocity_unit=1,
    acceleration=0,
    low=0,
    high=4095,
    phase=12,
    zero=0,
    turn=4096,
)
FULL_TURNS = 16


@pytest.mark.parametrize(
    ("shaft", "zero", "phase", "says"),
    [
        (2048.0, 0, 12, 2048),
        (2048.4, 0, 12, 2048),
        (4095.6, 0, 12, 0),
        (-1.0, 0, 12, 4095),
        (-1.0, 0, 12 + FULL_TURNS, -1),
        (6015.0, 0, 12 + FULL_TURNS, 6015),
        (2048.0, 85, 12, 1963),
    ],
)
def test_reading(shaft: float, zero: int, phase: int, says: int) -> None:
    assert reading(shaft, zero, phase, 4096) == says


@given(st.floats(-1e5, 1e5), st.integers(-2047, 2047))
def test_a_new_zero_keeps_the_reading_within_the_turn_and_the_offset_in_force(
    shaft: float, offset: int
) -> None:
    zero = zero_for(shaft, offset, 4096)
    assert reading(shaft, zero, FULL_TURNS, 4096) == (round(shaft) - offset) % 4096


@given(st.floats(0, 4095), st.integers(-2047, 2047), st.integers(0, 4095))
def test_a_goal_within_the_limits_is_what_is_read_at_the_end(shaft: float, offset: int, goal: int) -> None:
    settings = SHIPPED._replace(goal=goal, zero=zero_for(shaft, offset, 4096))
    motion = plan(settings, rest(0.0, shaft), 0.0, DRIVE, Switches())
    assert reading(motion.position(motion.done_at), settings.zero, 12, 4096) == goal


def test_a_weak_motor_rests_whatever_it_is_told() -> None:
    for mode in range(4):
        settings = SHIPPED._replace(strong=False, mode=mode, goal=1000, goal_velocity=1000, duty=500)
        for motion in (
            plan(settings, rest(0.0, 7.0), 0.0, DRIVE, Switches()),
            step(settings, rest(0.0, 7.0), 0.0, DRIVE, Switches()),
        ):
            assert (motion.position(9.0), motion.velocity(0.1)) == (7.0, 0.0)


def test_a_wheel_is_not_faster_than_its_motor() -> None:
    settings = SHIPPED._replace(mode=1, goal_velocity=100, velocity_unit=50)
    assert plan(settings, rest(0.0, 0.0), 0.0, DRIVE, Switches()).velocity(10.0) == 3400


def test_a_step_from_a_turning_wheel_counts_from_here() -> None:
    wheel = plan(SHIPPED._replace(mode=1, goal_velocity=1000), rest(0.0, 0.0), 0.0, DRIVE, Switches())
    motion = step(SHIPPED._replace(mode=3, goal=100), wheel, 5.0, DRIVE, Switches())
    assert motion.position(motion.done_at) == round(wheel.position(5.0)) + 100
