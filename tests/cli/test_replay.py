"""Replaying: a file is judged as a whole before anything moves, gone to, and carried out as it stands there."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Bench, Run
from tests.cli.test_follow import at

WAVE = "time (s),a1 (deg),c1 (deg)\n0,10,5\n1,30,-5\n2,10,5\n"
"""There and back."""


@pytest.fixture
def wave() -> Path:
    """A file in the present folder."""
    Path("wave.csv").write_text(WAVE, encoding="utf-8")
    return Path("wave.csv")


def test_it_goes_to_the_first_point_and_along(bench: Bench, run: Run, wave: Path) -> None:
    ran = run("replay", "wave.csv", "--smooth", "1.5", "--json")
    assert ran.code == 0, ran.err
    told = ran.document
    assert (told["schema"], told["simulated"]) == ("motorbus.replay.axes/1", True)
    assert told["duration"] == pytest.approx(2.0)
    assert [one["name"] for one in told["axes"]] == ["a1", "c1"]
    assert at(run, "a1", "c1") == pytest.approx([10, 5], abs=0.6)


def test_what_was_taught_is_replayed(bench: Bench, run: Run) -> None:
    assert run("move", "a1=25deg").code == 0
    assert run("teach", "a1", "--output", "still.csv", "--seconds", "1").code == 0
    assert run("move", "a1=0deg").code == 0
    ran = run("replay", "still.csv")
    assert ran.code == 0, ran.err
    assert at(run, "a1") == pytest.approx([25], abs=0.3)


def test_corners_are_too_hard_and_nothing_moves(bench: Bench, run: Run) -> None:
    Path("hard.csv").write_text("time (s),a1 (deg)\n0,5\n0.1,12\n0.2,5\n", encoding="utf-8")
    ran = run("replay", "hard.csv")
    assert (ran.code, ran.out) == (8, "")
    assert "its acceleration" in ran.err
    assert "--smooth 5" in ran.err
    assert at(run, "a1") == pytest.approx([0], abs=0.1)


def test_what_is_beyond_a_limit_is_told_with_the_file_and_its_rows(bench: Bench, run: Run) -> None:
    text = "# by hand\ntime (s),a1 (deg)\n3,0\n5,0\n9,140\n12,160\n13,160\n"
    Path("far.csv").write_text(text, encoding="utf-8")
    for words in ([], ["--speed", "0.5"], ["--dry-run"]):
        ran = run("replay", "far.csv", *words)
        assert (ran.code, ran.out) == (8, "")
        assert ran.err.startswith("error: far.csv, rows 3 to 4: a1: its position at ")
    text = "time (s),a1 (deg)\n0,0\n20,160\n21,160\n"
    Path("far.csv").write_text(text, encoding="utf-8")
    ran = run("replay", "far.csv", "--interpolation", "linear")
    assert ran.err.startswith("error: far.csv, row")


def test_a_dry_run_says_how_it_would_go_and_nothing_moves(bench: Bench, run: Run, wave: Path) -> None:
    ran = run("replay", "wave.csv", "--smooth", "1.5", "--speed", "0.5", "--dry-run")
    assert ran.code == 0, ran.err
    assert "would take 4 s" in ran.out
    assert "-150.0 deg to 150.0 deg" in ran.out
    assert at(run, "a1", "c1") == pytest.approx([0, 0], abs=0.1)
    told = run("replay", "wave.csv", "--smooth", "1.5", "--dry-run", "--json").document
    assert told["duration"] == pytest.approx(2.0)
    assert [one["first"] for one in told["axes"]] == pytest.approx([0.175, 0.087], abs=0.01)


def test_a_long_way_to_the_first_point_needs_somebody_who_agrees(bench: Bench, run: Run) -> None:
    assert run("move", "a1=-120deg").code == 0
    Path("far.csv").write_text("time (s),a1 (deg)\n0,100\n1,100\n", encoding="utf-8")
    ran = run("replay", "far.csv")
    assert (ran.code, ran.out) == (8, "")
    assert "move a1 by" in ran.err
    assert run("replay", "far.csv", "--yes").code == 0


@pytest.mark.parametrize(
    ("text", "code", "told"),
    [
        ("", 2, "w.csv"),
        ("time (s),nobody (deg)\n0,1\n1,2\n", 2, "nobody"),
        ("time (s),a1 (mm)\n0,1\n1,2\n", 2, "mm"),
        ("time (s),a1 (deg)\n0,1\n1,fast\n", 2, "fast"),
        ("time (s),a1 (deg)\n0,0\n9,170\n", 8, "position"),
        ("time (s),a1 (deg)\n0,0\n1,1\n1.1,90\n2,90\n", 8, "acceleration"),
        ("time (s),lift (mm)\n0,0\n9,0\n", 2, "lift"),
    ],
)
def test_a_file_that_cannot_be_replayed(text: str, code: int, told: str, bench: Bench, run: Run) -> None:
    Path("w.csv").write_text(text, encoding="utf-8")
    ran = run("replay", "w.csv", "--yes")
    assert (ran.code, ran.out) == (code, "")
    assert told in ran.err


@pytest.mark.parametrize(
    "words",
    [
        ("no-such.csv",),
        (),
        ("wave.csv", "--speed", "0"),
        ("wave.csv", "--speed", "quick"),
        ("wave.csv", "--repeat", "0"),
        ("wave.csv", "--smooth", "-1"),
        ("wave.csv", "--smooth", "nan"),
    ],
    ids=" ".join,
)
def test_what_cannot_be_said_ends_with_2(words: tuple[str, ...], bench: Bench, run: Run, wave: Path) -> None:
    ran = run("replay", *words)
    assert (ran.code, ran.out) == (2, "")
