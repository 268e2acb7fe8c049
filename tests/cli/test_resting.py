"""With --verify a stop tells what was seen beside what was promised, and ends otherwise where something still moves."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Bench, Run


def test_whoever_wants_to_know_is_told_what_was_seen(run: Run, bench: Bench) -> None:
    assert run("move", "arm#1=1", "--velocity", "1", "--no-wait").code == 0
    ran = run("stop", "--verify", "--json")
    assert ran.code == 0, ran.err
    told = {one["axis"]: one for one in ran.document["devices"]}
    assert {name: one["rest"] for name, one in told.items()} == {
        **dict.fromkeys(("a1", "a2", "a3", "c1"), "stopped"),
        "lift": "unseen",
    }
    assert "seen at rest" in told["a1"]["evidence"]
    assert "standstill was not verified" in told["a1"]["promise"]
    assert "nobody has seen it rest" in run("stop", "--verify").out


def test_without_being_asked_to_look_nobody_says_that_anything_rests(run: Run, bench: Bench) -> None:
    for one in run("stop", "--json").document["devices"]:
        assert not {"rest", "evidence"} & one.keys()


def test_what_still_moves_is_a_failure_of_its_own(
    run: Run, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    turned = iter(range(10_000))
    arm = bench.simulations["arm"]
    acts = dict.fromkeys(range(1, 10_000), lambda: setattr(arm[2], "raw_position", 2048 + 9 * next(turned)))
    bench.at_request(monkeypatch, acts)
    ran = run("stop", "--verify")
    assert ran.code == 9
    assert "a2 has accepted the stop and still moves" in ran.err
    assert ran.out.count("seen at rest") == 3


def test_who_falls_silent_afterwards_was_not_seen_to_rest(
    run: Run, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[int] = []
    arm = bench.simulations["arm"]

    def count() -> None:
        heard.append(1)

    bench.at_request(monkeypatch, dict.fromkeys(range(1, 10_000), count))
    assert run("stop", "a1").code == 0
    alone = len(heard)
    bench.at_request(monkeypatch, {alone + 1: arm[1].unplug})
    ran = run("stop", "a1", "--verify", "--json")
    assert ran.code == 9, ran.err
    assert ran.document["devices"][0]["rest"] == "unseen"


def test_others_that_failed_are_told_beside_what_was_not_seen(run: Run, bench: Bench) -> None:
    bench.simulations["arm"][3].unplug()
    ran = run("stop", "arm", "--verify")
    assert ran.code == 6
    assert ran.out.count("seen at rest") == 2
