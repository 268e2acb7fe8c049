"""What counts as a time without a goal, and for how long it is remembered."""

from __future__ import annotations

import pytest

from motorbus.motion.moving.gaps import LONG, MEMORY, Gaps


def test_before_the_first_goal_nobody_waits() -> None:
    assert Gaps(0.01).lately(1000.0) == 0.0


def test_goals_in_time_are_no_gap() -> None:
    gaps = Gaps(0.01)
    for number in range(100):
        gaps.left(number / 8)
        assert gaps.lately((number + 1) / 8) == 0.0
    assert LONG > 1 / 8


def test_a_gap_counts_while_it_lasts_and_for_a_while_behind_it() -> None:
    gaps = Gaps(0.01)
    gaps.left(5.0)
    assert gaps.lately(5.4) == pytest.approx(0.4)
    gaps.left(5.45)
    gaps.left(5.46)
    assert gaps.lately(5.47) == pytest.approx(0.45)
    for number in range(101):
        gaps.left(5.46 + number * MEMORY / 100)
    assert gaps.lately(5.46 + MEMORY) == 0.0


def test_where_goals_leave_seldom_three_periods_are_a_gap() -> None:
    gaps = Gaps(0.2)
    gaps.left(0.0)
    assert gaps.lately(0.59) == 0.0
    assert gaps.lately(0.61) == pytest.approx(0.61)
