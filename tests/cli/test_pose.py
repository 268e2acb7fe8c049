"""Poses: listed, gone to, and kept in a file that somebody wrote."""

from __future__ import annotations

from math import radians

import pytest

from motorbus.motion.machine import Machine
from tests.cli.conftest import Bench, Run


def poses(bench: Bench) -> dict[str, dict[str, float]]:
    """Those of the file."""
    return {name: dict(places) for name, places in Machine.load(bench.file).poses.items()}


def test_they_are_listed_and_nothing_is_opened(bench: Bench, run: Run) -> None:
    ran = run("pose", "-vv")
    assert ran.code == 0
    assert "a1 10.0 deg, c1 -5.0 deg" in ran.out
    assert "open" not in ran.err
    told = run("pose", "--json").document
    assert (told["schema"], told["poses"]) == ("motorbus.poses/1", poses(bench))


def test_where_there_is_none_it_says_how_to_keep_one(bench: Bench, run: Run) -> None:
    bench.file.write_text(bench.machine.text().partition("[pose.")[0], encoding="utf-8")
    ran = run("pose")
    assert (ran.code, ran.out) == (0, "")
    assert "pose --save NAME" in ran.err


def test_its_axes_go_there_together(bench: Bench, run: Run) -> None:
    told = run("pose", "ready", "--json").document
    assert told["schema"] == "motorbus.pose.axes/1"
    places = {one["name"]: one["present"] for one in told["axes"]}
    assert places == {
        "a1": pytest.approx(radians(10), abs=0.01),
        "c1": pytest.approx(radians(-5), abs=0.01),
    }
    assert "would take" in run("pose", "whole", "--assume", "lift=0", "--dry-run").out
    assert run("pose", "whole", "--assume", "lift=0").code == 0


def test_the_present_one_is_kept_and_the_file_stays_the_persons(bench: Bench, run: Run) -> None:
    assert run("move", "a1=12.5deg", "a2=-3deg").code == 0
    before = bench.file.read_text(encoding="utf-8")
    ran = run("pose", "--save", "grip", "a1", "a2", "--json")
    assert (ran.code, ran.document["schema"]) == (0, "motorbus.pose.save/1")
    after = bench.file.read_text(encoding="utf-8")
    assert after.startswith(before.rstrip("\n"))
    assert "# before work" in after
    assert poses(bench)["grip"] == {
        "a1": pytest.approx(radians(12.5), abs=0.01),
        "a2": pytest.approx(radians(-3), abs=0.01),
    }
    assert run("pose", "grip").code == 0
    assert list(bench.file.parent.glob("*.new")) == []


def test_who_does_not_know_where_it_is_is_left_out_unless_it_is_named(bench: Bench, run: Run) -> None:
    ran = run("pose", "--save", "rest")
    assert (ran.code, "lift: it is not known" in ran.err) == (0, True)
    assert list(poses(bench)["rest"]) == ["a1", "a2", "a3", "c1"]
    assert run("pose", "--save", "up", "lift").code == 8
    assert run("pose", "--save", "up", "lift", "--assume", "lift=5mm").code == 0
    assert poses(bench)["up"] == {"lift": pytest.approx(0.005)}


def test_a_pose_that_is_there_is_replaced_only_when_somebody_insists(bench: Bench, run: Run) -> None:
    before = bench.file.read_text(encoding="utf-8")
    ran = run("pose", "--save", "ready")
    assert (ran.code, "--force" in ran.err) == (2, True)
    assert bench.file.read_text(encoding="utf-8") == before
    assert run("pose", "--save", "ready", "a3", "--force").code == 0
    assert list(poses(bench)["ready"]) == ["a3"]


def test_a_place_outside_the_limits_is_not_kept(bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8")
    narrow = text.replace('low = "-150 deg"', 'low = "5 deg"', 1)
    bench.file.write_text(narrow.replace("[pose.ready]", "[pose.ready]", 1), encoding="utf-8")
    before = bench.file.read_text(encoding="utf-8")
    ran = run("pose", "--save", "grip", "a1")
    assert (ran.code, "outside the limits" in ran.err, "nothing was written" in ran.err) == (2, True, True)
    assert bench.file.read_text(encoding="utf-8") == before


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("redy", 2),
        ("a1", 2),
        ("ready whole", 2),
        ("ready --force", 2),
        ("ready --speed 2", 2),
        ("ready --duration 1ms", 2),
        ("--save Grip", 2),
        ("--save grip a9", 2),
        ("--save grip --dry-run", 2),
        ("--save grip --home", 2),
        ("--save grip --speed 50%", 2),
        ("--save grip a1 --colour red", 2),
        ("whole", 8),
    ],
)
def test_what_cannot_be_done_is_refused(words: str, code: int, bench: Bench, run: Run) -> None:
    before = bench.file.read_text(encoding="utf-8")
    ran = run("pose", *words.split())
    assert (ran.code, ran.out) == (code, ""), ran.err
    assert ran.err.count("error: ") == 1
    assert bench.file.read_text(encoding="utf-8") == before
