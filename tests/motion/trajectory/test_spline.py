"""The spline through samples: exact at them, without a jump of velocity, exact for a constant acceleration."""

from __future__ import annotations

from itertools import accumulate
from math import isclose

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.motion.trajectory.spline import spline

places = st.floats(-100, 100)
rows = st.lists(st.tuples(st.floats(0.01, 10), places), min_size=2, max_size=9)


@given(rows)
def test_it_meets_each_sample_and_its_velocity_never_jumps(rows: list[tuple[float, float]]) -> None:
    times = [0.0, *accumulate(gap for gap, _ in rows[1:])]
    lift = [place for _, place in rows]
    course = spline(times, {"lift": lift})
    for at, place in zip(times, lift, strict=True):
        assert course.positions(at) == {"lift": pytest.approx(place, abs=1e-9)}
    assert course.velocities_of["lift"][0] == course.velocities_of["lift"][-1] == 0.0
    for number, at in enumerate(times[1:-1], 1):
        step = 1e-6 * min(times[number] - times[number - 1], times[number + 1] - times[number])
        before, after = course.positions(at - step)["lift"], course.positions(at + step)["lift"]
        rate, fastest = course.velocities_of["lift"][number], 1e6 * step
        assert isclose((lift[number] - before) / step, rate, rel_tol=1e-2, abs_tol=1e-2 + fastest)
        assert isclose((after - lift[number]) / step, rate, rel_tol=1e-2, abs_tol=1e-2 + fastest)


def test_it_meets_a_constant_acceleration_exactly_and_turns_back_between_samples() -> None:
    times = [0.0, 0.1, 0.25, 0.3, 0.45, 0.6]
    tossed = spline(times, {"lift": [at * (0.5 - at) for at in times]})
    for at in (0.22, 0.251, 0.28, 0.31):
        assert tossed.positions(at) == pytest.approx({"lift": at * (0.5 - at)})


def test_it_rests_until_the_sample_at_which_a_movement_begins() -> None:
    times = [0.1 * number for number in range(8)]
    begun = spline(times, {"lift": [max(0.0, at - 0.3) ** 2 for at in times]})
    assert begun.positions(0.26)["lift"] == pytest.approx(0.0, abs=1e-15)
    assert begun.positions(0.44)["lift"] == pytest.approx(0.14**2)


def test_outside_of_its_duration_it_stands() -> None:
    course = spline([0.0, 1.0, 3.0], {"lift": [1.0, 2.0, 5.0]})
    assert course.duration == 3.0
    assert [course.positions(at)["lift"] for at in (-1.0, 3.0, 9.0)] == [1.0, 5.0, 5.0]
