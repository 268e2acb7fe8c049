"""Holding: torque where there is a switch for it, a stop elsewhere, and nothing moves."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Bench, Run


def test_the_whole_machine_holds_where_it_is(bench: Bench, run: Run) -> None:
    told = run("hold", "--json").document
    assert told["schema"] == "motorbus.hold/1"
    places = {one["name"]: one["present"] for one in told["axes"]}
    assert places == {name: pytest.approx(0, abs=0.01) for name in ("a1", "a2", "a3", "c1")} | {"lift": None}
    assert run("read", "a2", "torque_enable", "--json").document["registers"][0]["value"] == 1
    assert "a place that is not known" in run("hold").out


def test_some_axes_hold_and_others_do_not(bench: Bench, run: Run) -> None:
    assert run("hold", "a1").code == 0
    assert run("read", "a2", "torque_enable", "--json").document["registers"][0]["value"] == 0


def test_a_dry_run_shows_the_frames(bench: Bench, run: Run) -> None:
    ran = run("hold", "a1", "--dry-run", "--json")
    (frame,) = ran.document["withheld"]
    assert "torque_enable 1 (on)" in frame["meaning"]
    assert run("read", "a1", "torque_enable", "--json").document["registers"][0]["value"] == 0


@pytest.mark.parametrize("words", ["a9", "ready", "arm#1", "feetech:COM7", "a1 --colour red", "a1=10deg"])
def test_what_is_no_axis_is_refused(words: str, bench: Bench, run: Run) -> None:
    ran = run("hold", *words.split())
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
