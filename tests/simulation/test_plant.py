"""A movement has no jumps, keeps its limits and ends exactly at its goal."""

from __future__ import annotations

from math import inf, isclose, isfinite

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from motorbus.core.plant import Drive, Motion, move, run

places = st.floats(-50_000, 50_000)
velocities = st.floats(-5_000, 5_000)
speeds = st.floats(1, 5_000)
accelerations = st.floats(10, 50_000)
shares = st.floats(0, 1.2)


def moments(motion: Motion) -> list[float]:
    """Where phases meet, and some points between and after."""
    edges = [motion.start]
    for phase in motion.phases:
        edges += [edges[-1] + phase.duration / 3, edges[-1] + phase.duration]
    return [*edges, edges[-1] + 1.0]


def test_a_trapezoid_worked_out_by_hand() -> None:
    # 100 counts/s² up to 100 counts/s: 1 s and 50 counts at each end, 900 counts = 9 s between
    motion = move(5.0, 0.0, 1000.0, speed=100.0, acceleration=100.0)
    assert [phase.duration for phase in motion.phases] == [1.0, 9.0, 1.0]
    assert motion.done_at == 16.0
    assert motion.state(5.5) == (12.5, 50.0, 100.0)
    assert (motion.position(6.0), motion.position(15.0)) == (50.0, 950.0)
    assert (motion.position(15.5), motion.velocity(15.5)) == (987.5, 50.0)
    assert motion.state(16.0) == (1000.0, 0.0, 0.0)


def test_too_fast_to_stop_in_time_overshoots_and_comes_back() -> None:
    # at 100 counts/s it needs 50 counts to stop; the goal is 10 ahead
    motion = move(0.0, 0.0, 10.0, velocity=100.0, speed=100.0, acceleration=100.0)
    assert motion.position(1.0) == pytest.approx(50.0)
    assert motion.velocity(1.0) == pytest.approx(0.0)
    assert motion.velocity(1.2) < 0
    assert motion.position(motion.done_at) == 10.0


def test_a_wheel_speeds_up_and_never_ends() -> None:
    motion = run(0.0, 10.0, -100.0, acceleration=100.0)
    assert (motion.velocity(0.5), motion.velocity(1.0), motion.velocity(1e6)) == (-50.0, -100.0, -100.0)
    assert (motion.position(1.0), motion.position(3.0)) == (-40.0, -240.0)
    assert motion.done_at == inf
    assert motion.moving(1e9)


@given(places, places, places, velocities, speeds, speeds, accelerations, accelerations, shares)
def test_a_new_goal_on_the_way_does_not_jump_and_is_reached(
    start: float,
    goal: float,
    second: float,
    velocity: float,
    speed: float,
    other_speed: float,
    acceleration: float,
    other_acceleration: float,
    share: float,
) -> None:
    first = move(0.0, start, goal, velocity=velocity, speed=speed, acceleration=acceleration)
    at = first.done_at * share
    assume(isfinite(at))
    place, pace = first.position(at), first.velocity(at)
    motion = move(at, place, second, velocity=pace, speed=other_speed, acceleration=other_acceleration)
    assert isclose(motion.position(at), place, abs_tol=1e-6)
    assert isclose(motion.velocity(at), pace, abs_tol=1e-6)
    step = 1e-6
    for moment in moments(motion):
        before, after = max(at, moment - step), moment + step
        fastest = max(abs(pace), other_speed, abs(motion.velocity(before)))
        assert abs(motion.position(after) - motion.position(before)) <= 2 * step * fastest + 1e-5
        assert abs(motion.velocity(after) - motion.velocity(before)) <= 2 * step * other_acceleration + 1e-3
    assert motion.position(motion.done_at + 1e-9) == second
    assert motion.velocity(motion.done_at + 1e-9) == 0.0


@given(places, places, speeds, accelerations, shares, st.floats(-1, 1))
def test_it_never_exceeds_its_speed(
    start: float, goal: float, speed: float, acceleration: float, share: float, first: float
) -> None:
    motion = move(0.0, start, goal, velocity=first * speed, speed=speed, acceleration=acceleration)
    for moment in [*moments(motion), motion.done_at * share]:
        assert abs(motion.velocity(moment)) <= speed * (1 + 1e-9)


@given(places, places, speeds, accelerations)
def test_from_rest_it_never_turns_back(start: float, goal: float, speed: float, acceleration: float) -> None:
    motion = move(0.0, start, goal, speed=speed, acceleration=acceleration)
    low, high = sorted((start, goal))
    assert all(low - 1e-6 <= motion.position(moment) <= high + 1e-6 for moment in moments(motion))


def test_duty_and_current_follow_velocity_and_torque() -> None:
    drive = Drive(top_speed=3400.0, idle_current=0.15, stall_current=2.0)
    assert drive.duty(1700.0) == 0.5
    assert drive.duty(-3400.0) == -1.0
    assert drive.duty(3400.0, torque=0.5) == 1.0
    assert drive.current(0.0) == 0.0
    assert drive.current(100.0) == 0.15
    assert drive.current(-100.0, torque=-0.5) == pytest.approx(-1.15)
