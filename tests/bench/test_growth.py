"""Cost is looked at over servos, in both places, and the pictures are drawn from it and from the rows."""

from __future__ import annotations

from pathlib import Path

from bench import plots
from bench.figures import Spread
from bench.growth import MEMORY, WIRE, Point, points
from bench.row import Row


def silent(text: str) -> None:
    """Nobody watches."""


def test_everyone_is_measured_at_every_size_in_both_places() -> None:
    found = points(1, silent, sizes=(2,), count=1)
    assert {(point.place, point.contender) for point in found} >= {(MEMORY, "motorbus"), (WIRE, "motorbus")}
    assert {point.servos for point in found} == {2}
    assert all(point.seconds.median > 0 for point in found if point.place == MEMORY)


def test_the_pictures_are_drawn(tmp_path: Path) -> None:
    line = [
        Point(place, name, servos, Spread(servos * 1e-6, servos * 1e-6, servos * 2e-6))
        for place in (MEMORY, WIRE)
        for name in ("motorbus", "rustypot")
        for servos in (1, 253)
    ]
    plots.growth(tmp_path / "growth.png", line)
    rows = [
        Row("1", "a ratio", "somebody", "x", 0.5, 0.4, 0.6, "<= 0.85", "<= 0.7"),
        Row("6", "a share", "-", "%", 92.0, 90.0, 95.0, ">= 91", ">= 94"),
        Row("13", "a count of none", "-", "", 0.0, 0.0, 0.0, "<= 0"),
    ]
    plots.goals(tmp_path / "goals.png", rows)
    assert all((tmp_path / name).stat().st_size > 5000 for name in ("growth.png", "goals.png"))


def test_a_figure_is_a_factor_of_its_goal_in_the_direction_of_better() -> None:
    assert plots._factor(0.5, "<= 1.0") == plots._factor(7.0, ">= 3.5") == 0.5
    assert plots._factor(0.0, "<= 0") == 1.0
