"""The gate lets through what lies inside known limits, and nothing else that moves."""

from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.operation import Answer, Effect, Exchange, Goal, Rank
from motorbus.errors import LimitExceeded
from motorbus.motion.safety import Gate


def motion(*goals: Goal, rank: Rank = Rank.POLL) -> Exchange[Answer]:
    return Exchange(b"\x01", effect=Effect.MOTION, goals=goals, rank=rank)


@pytest.mark.parametrize("value", [-1.0, 0.0, 1.0])
def test_inside_the_limits_passes(value: float) -> None:
    Gate()(motion(Goal(1, "position", value, -1.0, 1.0)))


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (Goal(3, "position", nan, -1.0, 1.0), "not a finite number"),
        (Goal(3, "position", inf, -1.0, 1.0), "not a finite number"),
        (Goal(3, "position", 1.01, -1.0, 1.0), "lies outside -1 to 1"),
        (Goal(3, "position", -1.01, -1.0, 1.0), "lies outside -1 to 1"),
        (Goal(3, "position", 0.0), "limits are not known"),
        (Goal(3, "position", 0.0, -1.0, None), "limits are not known"),
    ],
)
def test_everything_else_is_refused_with_the_reason(goal: Goal, why: str) -> None:
    with pytest.raises(LimitExceeded, match=why) as caught:
        Gate()(motion(Goal(1, "position", 0.0, -1.0, 1.0), goal))
    assert caught.value.node == 3
    assert "nothing was sent" in str(caught.value)


def test_motion_that_does_not_say_where_to_is_refused() -> None:
    with pytest.raises(LimitExceeded, match="does not say where"):
        Gate()(motion())


@pytest.mark.parametrize("effect", [Effect.NONE, Effect.PERSISTENT, Effect.IDENTITY, Effect.TORQUE])
def test_what_does_not_move_passes(effect: Effect) -> None:
    Gate()(Exchange(b"\x01", effect=effect))


def test_a_stop_always_passes() -> None:
    Gate()(motion(rank=Rank.STOP))


@given(st.floats(), st.floats(-100, 100), st.floats(0, 100))
def test_a_goal_passes_exactly_when_it_lies_inside(value: float, low: float, width: float) -> None:
    slack = 1e-6
    try:
        Gate()(motion(Goal(1, "position", value, low, low + width)))
        passed = True
    except LimitExceeded:
        passed = False
    if low <= value <= low + width:
        assert passed
    if not low - slack <= value <= low + width + slack:
        assert not passed
