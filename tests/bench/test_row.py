"""A row is judged by its own goal and by the margin of its kind."""

from __future__ import annotations

import pytest

from bench.row import PROCESS, Row, limit, met, pairs, reaches, shown, verdict

ROW = Row("1", "in process: read1", "somebody", "x", 0.8, 0.7, 0.9, "<= 0.85", "<= 0.7")


@pytest.mark.parametrize(
    ("goal", "parts"),
    [("<= 0.85", ("<=", 0.85)), (">=3.5", (">=", 3.5)), ("< 2", ("<", 2.0)), ("= 0", ("=", 0.0))],
)
def test_a_goal_is_a_comparator_and_a_number(goal: str, parts: tuple[str, float]) -> None:
    assert limit(goal) == parts


@pytest.mark.parametrize("goal", ["", "0.85", "at most 3", "<= many"])
def test_anything_else_is_no_goal(goal: str) -> None:
    with pytest.raises(ValueError, match="is no goal"):
        limit(goal)


@pytest.mark.parametrize(
    ("value", "goal", "margin", "kept"),
    [
        (0.85, "<= 0.85", 0.0, True),
        (0.86, "<= 0.85", 0.0, False),
        (0.97, "<= 0.85", 0.15, True),
        (0.98, "<= 0.85", 0.15, False),
        (3.0, ">= 3.5", 0.15, True),
        (2.9, ">= 3.5", 0.15, False),
        (2.0, "< 2", 0.0, False),
        (0.0, "= 0", 0.25, True),
        (1.0, "= 0", 0.25, False),
    ],
)
def test_the_margin_eases_a_goal_in_its_own_direction(
    value: float, goal: str, margin: float, kept: bool
) -> None:
    assert reaches(value, goal, margin) is kept


@pytest.mark.parametrize(
    ("value", "words", "counts"),
    [
        (0.7, "met, stretch too", True),
        (0.8, "met", True),
        (0.9, "met within 15%", True),
        (1.0, "MISSED", False),
    ],
)
def test_the_verdict_says_how_well(value: float, words: str, counts: bool) -> None:
    row = ROW._replace(value=value)
    assert (verdict(row), met(row)) == (words, counts)
    assert met(row._replace(margin=PROCESS))


def test_a_row_without_a_goal_is_told_and_not_judged() -> None:
    row = ROW._replace(value=99.0, goal="", stretch="")
    assert (verdict(row), met(row)) == ("no goal", True)


def test_ratios_are_taken_round_by_round() -> None:
    assert pairs([1.0, 10.0, 3.0], [2.0, 40.0, 3.0]) == (0.5, 0.25, 1.0)


def test_a_figure_is_shown_with_its_unit() -> None:
    assert [shown(0.456, "x"), shown(94.44, "%"), shown(3.0, "calls")] == ["0.46", "94.4 %", "3.00 calls"]
