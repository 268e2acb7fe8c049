"""Shaft, zero and reading: the arithmetic behind the modes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.plant import Drive, rest
from motorbus.families.feetech.simulator.motor import Settings, mirrored, plan, reading, step, zero_for
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import Mode

DRIVE = Drive(top_speed=3400.0, idle_current=0.15, stall_current=3.25)
SHIPPED = Settings(torque=1.0)


@pytest.mark.parametrize(
    ("shaft", "zero", "told", "says"),
    [
        (2048.0, 0, False, 2048),
        (2048.4, 0, False, 2048),
        (4095.6, 0, False, 0),
        (-1.0, 0, False, 4095),
        (-1.0, 0, True, -1),
        (6015.0, 0, True, 6015),
        (2048.0, 85, False, 1963),
    ],
)
def test_reading(shaft: float, zero: int, told: bool, says: int) -> None:
    assert reading(shaft, zero, told, 4096) == says


def test_a_reading_in_steps_of_several_counts() -> None:
    assert reading(6015.0, 15, True, 4096, 3) == 2000
    assert reading(3 * 4097.0, 0, False, 4096, 3) == 1


@given(st.floats(-1e5, 1e5), st.integers(-2047, 2047))
def test_a_new_zero_keeps_the_reading_within_the_turn_and_the_offset_in_force(
    shaft: float, offset: int
) -> None:
    zero = zero_for(shaft, offset, 4096)
    assert reading(shaft, zero, True, 4096) == (round(shaft) - offset) % 4096


@given(st.floats(0, 4095), st.integers(-2047, 2047), st.integers(0, 4095))
def test_a_goal_within_the_limits_is_what_is_read_at_the_end(shaft: float, offset: int, goal: int) -> None:
    settings = SHIPPED._replace(goal=goal, zero=zero_for(shaft, offset, 4096))
    motion = plan(settings, rest(0.0, shaft), 0.0, DRIVE, Switches())
    assert reading(motion.position(motion.done_at), settings.zero, False, 4096) == goal


def test_a_weak_motor_rests_whatever_it_is_told() -> None:
    for mode in Mode:
        settings = SHIPPED._replace(torque=0.009, mode=mode, goal=1000, velocity=1000, duty=0.5, current=0.5)
        for motion in (
            plan(settings, rest(0.0, 7.0), 0.0, DRIVE, Switches()),
            step(settings, rest(0.0, 7.0), 0.0, DRIVE, Switches()),
        ):
            assert (motion.position(9.0), motion.velocity(0.1)) == (7.0, 0.0)


def test_a_wheel_is_not_faster_than_its_motor() -> None:
    settings = SHIPPED._replace(mode=Mode.VELOCITY, velocity=5000)
    assert plan(settings, rest(0.0, 0.0), 0.0, DRIVE, Switches()).velocity(10.0) == 3400


def test_a_step_from_a_turning_wheel_counts_from_here() -> None:
    wheeling = SHIPPED._replace(mode=Mode.VELOCITY, velocity=1000)
    wheel = plan(wheeling, rest(0.0, 0.0), 0.0, DRIVE, Switches())
    motion = step(SHIPPED._replace(mode=Mode.STEP, goal=100), wheel, 5.0, DRIVE, Switches())
    assert motion.position(motion.done_at) == round(wheel.position(5.0)) + 100


@pytest.mark.parametrize(
    ("current", "burden", "goes"), [(0.3, 0.0, 1), (0.3, 0.4, -1), (-0.2, 0.0, -1), (0.3, 0.3, 0)]
)
def test_a_constant_current_wins_or_loses_against_the_outside(
    current: float, burden: float, goes: int
) -> None:
    settings = SHIPPED._replace(mode=Mode.CURRENT, current=current, burden=burden)
    assert plan(settings, rest(0.0, 0.0), 0.0, DRIVE, Switches()).velocity(100.0) == goes * 3400


@given(st.floats(0, 4000), st.floats(0.05, 5))
def test_a_way_takes_the_time_it_is_given_or_as_long_as_it_must(way: float, time: float) -> None:
    settings = SHIPPED._replace(goal=round(way), time=time)
    motion = plan(settings, rest(0.0, 0.0), 0.0, DRIVE, Switches())
    fastest = plan(SHIPPED._replace(goal=round(way)), rest(0.0, 0.0), 0.0, DRIVE, Switches())
    wanted = max(time, fastest.done_at) if round(way) else 0.0
    assert motion.done_at == pytest.approx(wanted, rel=1e-5)


def test_a_mirror_shows_the_same_movement_the_other_way_round() -> None:
    there = plan(SHIPPED._replace(goal=4000), rest(0.0, 100.0), 0.0, DRIVE, Switches())
    back = mirrored(there)
    for at in (0.0, 0.1, 0.7, 5.0):
        assert back.position(at) == -there.position(at)
        assert back.velocity(at) == -there.velocity(at)
    assert mirrored(back) == there


def test_a_loop_of_the_wrong_sign_runs_from_its_goal() -> None:
    away = plan(SHIPPED._replace(goal=3000, runs_away=True), rest(0.0, 2000.0), 0.0, DRIVE, Switches())
    assert away.velocity(10.0) == -3400
    still = plan(SHIPPED._replace(goal=2000, runs_away=True), rest(0.0, 2000.0), 0.0, DRIVE, Switches())
    assert not still.moving(0.0)
    wheel = SHIPPED._replace(mode=Mode.VELOCITY, velocity=10, runs_away=True)
    assert plan(wheel, rest(0.0, 2000.0), 0.0, DRIVE, Switches()).velocity(10.0) == -3400
