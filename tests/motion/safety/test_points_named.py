"""The page on safety names, for each of its fifteen points, a test that bears its number, and only tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "explanation" / "safety.md"
ROW = re.compile(r"^\| (\d+) ([^|]+)\|([^|]+)\|([^|]+)\|$", re.MULTILINE)
NAMED = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")
SHORT = re.compile(r"`(test_\d\d_\w+)`")
POINTS = ("tests/motion/safety/test_points.py", "tests/motion/safety/test_points_from_9.py")


def rows() -> dict[int, str]:
    """What the table says, by the number of the point."""
    return {
        int(number): line
        for number, *rest in ROW.findall(PAGE.read_text(encoding="utf-8"))
        for line in [" ".join(rest)]
    }


def named_in(path: str) -> set[str]:
    return set(re.findall(r"^def (test_\w+)", (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE))


def test_every_point_has_its_row() -> None:
    assert sorted(rows()) == list(range(1, 16))


@pytest.mark.parametrize("number", range(1, 16))
def test_every_point_has_a_test_that_bears_its_number_and_is_named(number: int) -> None:
    bearing = {name for path in POINTS for name in named_in(path) if name.startswith(f"test_{number:02}_")}
    assert bearing
    assert set(SHORT.findall(rows()[number])) == bearing


@pytest.mark.parametrize(("path", "name"), sorted(set(NAMED.findall(PAGE.read_text(encoding="utf-8")))))
def test_what_the_page_names_exists(path: str, name: str) -> None:
    assert (ROOT / path).is_file()
    assert not name or name in named_in(path)
