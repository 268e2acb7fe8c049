"""Following: one axis is led by hand and the other comes after it, within limits, and far only if somebody agrees."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Bench, Run


def at(run: Run, *axes: str) -> list[float]:
    """Where these axes are, in degrees, as a movement that goes nowhere tells."""
    ran = run("move", *(f"{axis}+=0deg" for axis in axes), "--json")
    assert ran.code == 0, ran.err
    return [57.29578 * one["present"] for one in ran.document["axes"]]


def test_the_follower_goes_where_its_leader_stands(bench: Bench, run: Run) -> None:
    assert run("move", "a1=40deg", "a2=-20deg").code == 0
    ran = run("follow", "a1", "a2", "--seconds", "3")
    assert ran.code == 0, ran.err
    assert "a1: the torque goes off now" in ran.err
    assert "3.0 s, 301 cycles" in ran.out
    assert bench.simulations["arm"][1].memory["torque_enable"] == 0
    assert bench.simulations["arm"][2].memory["torque_enable"] == 1
    assert at(run, "a2") == [pytest.approx(40, abs=0.5)]


def test_axes_of_other_families_follow_too(bench: Bench, run: Run) -> None:
    assert run("move", "a1=15deg").code == 0
    ran = run("follow", "a1", "c1", "--seconds", "2", "--json")
    assert ran.code == 0, ran.err
    assert (ran.document["schema"], ran.document["simulated"]) == ("motorbus.follow/1", True)
    (pair,) = ran.document["pairs"]
    assert (pair["leader"], pair["follower"], pair["held"]) == ("a1", "c1", 0)
    assert abs(pair["apart"]) < 0.01


def test_a_leader_where_its_follower_may_not_go_is_not_followed(bench: Bench, run: Run) -> None:
    assert run("move", "a1=100deg").code == 0
    ran = run("follow", "a1", "c1", "--seconds", "1", "--json")
    assert ran.code == 0, ran.err
    assert ran.document["pairs"][0]["held"] == 101
    assert at(run, "c1") == [pytest.approx(0, abs=0.2)]


def test_with_clamp_it_goes_as_far_as_it_may_and_that_is_told(bench: Bench, run: Run) -> None:
    assert run("move", "a1=100deg").code == 0
    ran = run("follow", "a1", "c1", "--seconds", "2", "--clamp", "--json")
    assert ran.code == 0, ran.err
    (pair,) = ran.document["pairs"]
    assert (pair["held"], pair["clamped"]) == (0, 200)
    assert at(run, "c1") == [pytest.approx(50, abs=0.5)]
    notes = [line for line in ran.err.splitlines() if "c1 goes to 50.0 deg instead of" in line]
    assert 2 <= len(notes) <= 5  # of 200
    assert notes[0].endswith("for its limits")


def test_a_long_way_to_the_leader_needs_somebody_who_agrees(bench: Bench, run: Run) -> None:
    assert run("move", "a1=120deg", "a2=-120deg").code == 0
    ran = run("follow", "a1", "a2", "--seconds", "5")
    assert (ran.code, ran.out) == (8, "")
    assert "move a2 by 239.9 deg" in ran.err
    assert bench.simulations["arm"][1].memory["torque_enable"] == 1
    assert run("follow", "a1", "a2", "--seconds", "5", "--yes").code == 0


def test_a_dry_run_shows_how_far_they_are_apart(bench: Bench, run: Run) -> None:
    assert run("move", "a1=40deg").code == 0
    ran = run("follow", "a1", "a2", "--dry-run")
    assert ran.code == 0, ran.err
    assert "40.0 deg" in ran.out
    assert bench.simulations["arm"][1].memory["torque_enable"] == 1
    assert at(run, "a2") == [pytest.approx(0, abs=0.2)]


@pytest.mark.parametrize(
    "words",
    [
        ("a1",),
        ("a1", "nobody"),
        ("a1", "a1"),
        ("arm", "can"),
        ("arm", "a1"),
        ("a1", "lift"),
        ("lift", "a1"),
        ("a1", "a2", "--seconds", "0"),
        ("a1", "a2", "--rate", "nan"),
    ],
    ids=" ".join,
)
def test_what_cannot_follow_ends_with_2_and_nobody_is_let_go(
    words: tuple[str, ...], bench: Bench, run: Run
) -> None:
    assert run("hold", "arm").code == 0
    ran = run("follow", *words)
    assert (ran.code, ran.out) == (2, ""), ran.err
    assert "error: " in ran.err
    assert [bench.simulations["arm"][node].memory["torque_enable"] for node in (1, 2, 3)] == [1, 1, 1]
