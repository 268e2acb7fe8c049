"""Parking: where the machine file says, and only what has such a place."""

from __future__ import annotations

from math import radians

import pytest

from tests.cli.conftest import Bench, Run


def test_every_axis_with_a_place_goes_there(bench: Bench, run: Run) -> None:
    told = run("park", "--assume", "lift=0mm", "--json").document
    assert told["schema"] == "motorbus.park.axes/1"
    places = {one["name"]: one["present"] for one in told["axes"]}
    assert places == {"a1": pytest.approx(radians(30), abs=0.01), "lift": pytest.approx(0.002, abs=1e-4)}


def test_some_axes_park_and_a_group_those_of_it_that_can(bench: Bench, run: Run) -> None:
    assert [one["name"] for one in run("park", "upper", "--json").document["axes"]] == ["a1"]
    assert "would take" in run("park", "a1", "--dry-run").out


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("a2", 2),
        ("can", 2),
        ("a1 a2", 2),
        ("a9", 2),
        ("ready", 2),
        ("arm#1", 2),
        ("a1 --speed 2", 2),
        ("a1 --duration 1ms", 2),
        ("a1 --assume a1=0", 2),
        ("a1 --colour red", 2),
        ("", 8),
        ("lift", 8),
    ],
)
def test_what_cannot_park_is_refused_and_nothing_moves(words: str, code: int, bench: Bench, run: Run) -> None:
    ran = run("park", *words.split())
    assert (ran.code, ran.out) == (code, ""), ran.err
    assert ran.err.count("error: ") == 1
    (one,) = run("hold", "a1", "--json").document["axes"]
    assert one["present"] == pytest.approx(0, abs=0.01)
