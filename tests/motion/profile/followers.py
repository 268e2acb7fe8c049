"""What every follower must do, whatever works it out: run after goals that change, and never jump."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan
from typing import TypeAlias

import pytest
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.profile import Follower, Limits

Chase: TypeAlias = list[tuple[float, int]]
"""Goals, and for how many steps each of them holds."""
PERIOD = 0.01
chases: st.SearchStrategy[Chase] = st.lists(
    st.tuples(st.floats(-10, 10), st.integers(1, 60)), min_size=1, max_size=6
)
limits = st.builds(Limits, st.floats(0.1, 20), st.floats(0.1, 100), st.none() | st.floats(0.1, 100))


def chase(one: Follower, goals: Chase) -> list[tuple[float, float]]:
    """Position and velocity after each step, from where it is."""
    seen = [(one.position, one.velocity)]
    for goal, steps in goals:
        for _ in range(steps):
            position = one.step(PERIOD, goal)
            assert position == one.position
            seen.append((position, one.velocity))
    return seen


def assert_gentle(seen: list[tuple[float, float]], goals: Chase, may: Limits, hardest: float) -> None:
    """Within velocity and acceleration, position the sum of velocity, and inside what goals and start enclose."""
    places = [seen[0][0], *(goal for goal, _ in goals)]
    low, high = min(places), max(places)
    for (before, slow), (position, velocity) in pairwise(seen):
        assert abs(velocity) <= may.velocity * (1 + 1e-6)
        assert abs(velocity - slow) <= hardest * PERIOD * (1 + 1e-6) + 1e-9
        assert abs(position - before - (velocity + slow) / 2 * PERIOD) <= hardest * PERIOD**2 + 1e-9
        assert low - 1e-6 <= position <= high + 1e-6


def settle(one: Follower) -> None:
    """Let it arrive."""
    one.step(1e6)
    assert one.arrived
    assert (one.position, one.velocity) == (one.goal, 0.0)


def assert_refuses_nonsense(one: Follower) -> None:
    """Bad figures change nothing."""
    one.step(0.05, 1.0)
    before = one.position, one.velocity, one.goal
    for figure in (nan, inf):
        with pytest.raises(RequestError, match="have gone by"):
            one.step(figure)
        with pytest.raises(RequestError, match="goal is"):
            one.step(0.1, figure)
        with pytest.raises(RequestError, match=r"(position|start) is"):
            one.reset(figure)
    with pytest.raises(RequestError, match="have gone by"):
        one.step(-0.1)
    assert (one.position, one.velocity, one.goal) == before


def assert_starts_again(one: Follower) -> None:
    """After a reset it rests where it was put."""
    one.step(0.1, 5.0)
    one.reset(2.0)
    assert (one.position, one.velocity, one.goal, one.arrived) == (2.0, 0.0, 2.0, True)
    assert one.step(1.0) == 2.0
