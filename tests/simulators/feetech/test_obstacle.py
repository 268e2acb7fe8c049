"""A movement with obstacles: where and when it ends, and that it never gets beyond."""

from __future__ import annotations

from itertools import pairwise
from math import inf, isclose

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.plant import Phase, move
from motorbus.families.feetech.simulator.obstacle import Stretch, obstructed, stretches

places = st.floats(-50_000, 50_000)
velocities = st.floats(-5_000, 5_000)
speeds = st.floats(1, 5_000)
accelerations = st.floats(10, 50_000)


def test_a_movement_in_parts_of_one_direction() -> None:
    # at -20 counts/s it brakes for 0.2 s and 2 counts first, then goes the other way
    motion = move(1.0, 0.0, 100.0, velocity=-20.0, speed=50.0, acceleration=100.0)
    parts = list(stretches(motion))
    assert [part.way for part in parts] == [-1.0, 1.0, 1.0, 1.0, 0.0]
    assert (parts[0].begin, parts[0].end, parts[0].velocity) == (1.0, 1.2, -20.0)
    assert (parts[1].position, parts[1].velocity) == pytest.approx((-2.0, 0.0))
    assert all(one.end == other.begin for one, other in pairwise(parts))
    assert parts[-1] == Stretch(motion.done_at, inf, 100.0, 0.0, 0.0)


def test_it_ends_at_the_obstacle_worked_out_by_hand() -> None:
    # 50 counts in the first second, then 100 counts/s: 250 is reached after 3 s, at once and at rest
    motion = obstructed(move(5.0, 0.0, 1000.0, speed=100.0, acceleration=100.0), -10.0, 250.0)
    assert motion.phases == (Phase(1.0, 0.0, 0.0, 100.0), Phase(2.0, 50.0, 100.0, 0.0))
    assert (motion.done_at, motion.goal, motion.position(99.0), motion.velocity(8.0)) == (
        8.0,
        250.0,
        250.0,
        0.0,
    )


def test_standing_at_the_obstacle_only_the_way_back_is_free() -> None:
    into = obstructed(move(2.0, 100.0, 300.0, speed=10.0), 0.0, 100.0)
    assert (into.phases, into.goal) == ((), 100.0)
    away = move(2.0, 100.0, 50.0, speed=10.0)
    assert obstructed(away, 0.0, 100.0) is away


def test_an_overshoot_ends_where_the_obstacle_is() -> None:
    # at 100 counts/s it needs 50 counts to stop for a goal 10 ahead; the wall is at 30
    motion = obstructed(move(0.0, 0.0, 10.0, velocity=100.0, speed=100.0, acceleration=100.0), -inf, 30.0)
    assert motion.goal == 30.0
    assert motion.done_at == pytest.approx(1 - 0.4**0.5)  # 30 = 100 t - 50 t²


@given(places, places, velocities, speeds, accelerations, places, st.floats(0, 10_000))
def test_it_never_gets_beyond_and_is_the_same_until_then(
    start: float, goal: float, velocity: float, speed: float, acceleration: float, low: float, wide: float
) -> None:
    plan = move(0.0, start, goal, velocity=velocity, speed=speed, acceleration=acceleration)
    high = low + wide
    motion = obstructed(plan, low, high)
    end = min(motion.done_at, 1e6)
    for share in (0.0, 0.1, 0.5, 0.9, 0.999999):
        assert isclose(motion.position(end * share), plan.position(end * share), abs_tol=1e-3, rel_tol=1e-9)
    if low <= start <= high:
        for share in (0.2, 0.7, 1.0, 1.5):
            assert low - 1e-3 <= motion.position(end * share) <= high + 1e-3
