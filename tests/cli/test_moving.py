"""Axes moved together from the shell: what is understood, what is asked, what is shown, and what is refused unmoved."""

from __future__ import annotations

import json
from math import radians

import pytest

from tests.cli.conftest import Bench, Run


def stand(run: Run) -> dict[str, float]:
    """Where the axes are that measure it (rad)."""
    places = run("hold", "led", "--json").document["axes"]
    return {one["name"]: one["present"] for one in places}


def test_axes_of_three_families_go_in_one_movement(bench: Bench, run: Run) -> None:
    ran = run("move", "a1=10deg", "c1=-0.1", "lift=5mm", "--assume", "lift=0mm", "--json")
    assert (ran.code, ran.err) == (0, "")
    told = ran.document
    assert (told["schema"], told["simulated"]) == ("motorbus.move.axes/1", True)
    goals = {one["name"]: one["goal"] for one in told["axes"]}
    assert goals == {"a1": pytest.approx(radians(10)), "c1": -0.1, "lift": pytest.approx(0.005)}
    for one in told["axes"]:
        assert one["present"] == pytest.approx(one["goal"], abs=0.02)
        assert one["error"] == one["present"] - one["goal"]
        assert one["estimated"] is (one["name"] == "lift")
    assert 0 <= told["started_apart"] < 0.005
    assert 0 <= told["ended_apart"] < 0.1 * told["duration"]
    assert told["limited_by"]["axis"] == "lift"


def test_a_person_sees_a_table_in_the_units_of_the_axes(bench: Bench, run: Run) -> None:
    ran = run("move", "a1=10deg", "lift=5mm", "--assume", "lift=0mm")
    assert ran.code == 0
    assert ran.out.startswith("simulated\n")
    assert "10.0 deg" in ran.out
    assert "5.00 mm" in ran.out
    assert "estimated" in ran.out
    assert "orders left within" in ran.out


def test_a_way_begins_where_the_axis_stands(bench: Bench, run: Run) -> None:
    assert run("move", "a1=10deg").code == 0
    assert run("move", "a1+=5deg", "c1-=2deg").code == 0
    there = stand(run)
    assert there["a1"] == pytest.approx(radians(15), abs=0.01)
    assert there["c1"] == pytest.approx(radians(-2), abs=0.01)


def test_a_group_goes_to_one_position(bench: Bench, run: Run) -> None:
    assert run("move", "upper=-4deg", "--speed", "50%", "--kind", "minimum_jerk").code == 0
    there = stand(run)
    assert [there[name] for name in ("a1", "a2", "a3")] == [pytest.approx(radians(-4), abs=0.01)] * 3
    assert there["c1"] == pytest.approx(0, abs=0.01)


def test_it_lasts_as_long_as_it_shall(bench: Bench, run: Run) -> None:
    told = run("move", "a1=10deg", "--duration", "3s", "--json").document
    assert told["duration"] == 3.0
    assert told["limited_by"] == {"axis": "", "reason": "duration"}
    assert "as asked for" in run("move", "a1=0", "--duration", "3s").out


def test_an_axis_that_does_not_know_where_it_is_must_be_told(bench: Bench, run: Run) -> None:
    ran = run("move", "lift=5mm", "a1=10deg")
    assert (ran.code, ran.out) == (8, "")
    assert "--assume lift=0mm" in ran.err
    assert stand(run)["a1"] == pytest.approx(0, abs=0.01)


def test_or_finds_out_itself(bench: Bench, run: Run) -> None:
    assert run("move", "lift=5mm", "--home").code == 8
    ran = run("move", "lift=5mm", "--home", "--yes", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert ran.document["axes"][0]["present"] == pytest.approx(0.005, abs=1e-4)


def test_a_long_way_needs_agreement(bench: Bench, run: Run) -> None:
    assert run("move", "a1=-100deg").code == 0
    ran = run("move", "a1=100deg")
    assert (ran.code, "move a1 by 200.0 deg" in ran.err) == (8, True)
    assert run("move", "a1=100deg", "--yes").code == 0
    ran = run("move", "lift=150mm", "--assume", "lift=0mm")
    assert (ran.code, "move lift by 150.00 mm" in ran.err) == (8, True)


def test_a_dry_run_tells_the_plan_and_moves_nothing(bench: Bench, run: Run) -> None:
    words = ("move", "a1=10deg", "lift=5mm", "--assume", "lift=0mm", "--dry-run")
    told = run(*words, "--json").document
    assert told["schema"] == "motorbus.move.plan/1"
    assert {one["name"]: one["present"] for one in told["axes"]} == {"a1": 0.0, "lift": 0.0}
    assert told["duration"] > 0
    assert "nothing was sent" in run(*words).out
    assert stand(run)["a1"] == pytest.approx(0, abs=0.01)
    ran = run("move", "lift=5mm", "--home", "--dry-run")
    assert (ran.code, "would home first" in ran.err) == (0, True)
    assert run("move", "a1=200deg", "--dry-run").code == 8
    assert run("move", "a1=10deg", "--duration", "0.01", "--dry-run").code == 2


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("a1=nan", 2),
        ("a1=far", 2),
        ("a1=10mm", 2),
        ("lift=10deg --assume lift=0", 2),
        ("a1", 2),
        ("=10deg", 2),
        ("a9=10deg", 2),
        ("ready=10deg", 2),
        ("a1=1 upper=2", 2),
        ("a1=151deg", 8),
        ("a1=10deg a2=-200deg", 8),
        ("a1=10deg --duration 1ms", 2),
        ("a1=10deg --duration -1", 2),
        ("a1=10deg --duration long", 2),
        ("a1=10deg --speed 0", 2),
        ("a1=10deg --speed 101%", 2),
        ("a1=10deg --kind jump", 2),
        ("a1=10deg --velocity 1", 2),
        ("a1=10deg --acceleration 1", 2),
        ("a1=10deg --no-wait", 2),
        ("a1=10deg arm#2=1", 2),
        ("a1=10deg --assume a1=0", 2),
        ("lift=1mm --assume lift", 2),
        ("lift=1mm --assume lift+=1mm", 2),
        ("lift=1mm --assume lift=0,lift=1mm", 2),
        ("arm#1=3.0 --duration 2s", 2),
        ("arm#1=3.0 --home", 2),
        ("c1=1deg --home --pace fast", 2),
    ],
)
def test_what_cannot_be_done_is_refused_and_nothing_moves(
    words: str, code: int, bench: Bench, run: Run
) -> None:
    before = stand(run)
    ran = run("move", *words.split(), "--yes")
    assert (ran.code, ran.out) == (code, ""), ran.err
    assert ran.err.count("error: ") == 1
    assert stand(run) == before


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("move a1=nan", "a1: position 'nan' is not a number"),
        ("move a2=1deg a1+=5mm", "a1: position '5mm' has the unit 'mm'"),
        ("move a1=1deg --duration -1", "--duration -1: not above 0"),
        ("jog a1=1deg/s --seconds -1", "--seconds -1: not above 0"),
        ("jog a1=nan --seconds 1", "a1: velocity 'nan' is not a number"),
        ("teach a1 --output w.csv --seconds 0", "--seconds 0: not above 0"),
        ("follow a1 a2 --seconds 0", "--seconds 0: not above 0"),
        ("loop-stats a1 --seconds 0", "--seconds 0: not above 0"),
        ("move a1=1deg --duration nan", "--duration: time 'nan' is not a number"),
        ("jog a1=1deg/s --seconds x", "--seconds: time 'x' is not a number"),
        ("teach a1 --output w.csv --seconds inf", "--seconds: time 'inf' is not a number"),
    ],
)
def test_what_is_no_figure_names_its_axis_or_flag_and_a_fix(
    words: str, says: str, bench: Bench, run: Run
) -> None:
    ran = run(*words.split(), "--json")
    assert (ran.code, ran.out) == (2, "")
    told = json.loads(ran.err)
    assert told["summary"].startswith(says)
    assert told["expected"]
    assert told["advice"].endswith("nothing was sent")
    assert says.startswith("a1") or told["advice"] != "nothing was sent"
