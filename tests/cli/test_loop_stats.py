"""Figures of a loop: what it reached, what it lost, and that nothing moves unless somebody says --hold."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Bench, Run


def torques(bench: Bench) -> list[int]:
    return [bench.simulations["arm"][node].memory["torque_enable"] for node in (1, 2, 3)]


def test_it_reads_and_nothing_else(bench: Bench, run: Run) -> None:
    ran = run("loop-stats", "arm", "--rate", "100", "--seconds", "2", "--json")
    assert ran.code == 0, ran.err
    told = ran.document
    assert (told["schema"], told["simulated"], told["rate"]) == ("motorbus.loop-stats/1", True, 100)
    assert told["achieved_rate"] == pytest.approx(100, rel=0.001)
    assert (told["cycles"], told["overruns"], told["skipped"]) == (201, 0, 0)
    assert (told["lost"], told["without"]) == ({}, [])
    assert told["buses"]["arm"]["axes"] == ["a1", "a2", "a3"]
    assert told["cycle"]["mean"] > 0
    assert torques(bench) == [0, 0, 0]


def test_with_hold_the_axes_have_torque_and_stay(bench: Bench, run: Run) -> None:
    ran = run("loop-stats", "arm", "--rate", "100", "--seconds", "1", "--hold")
    assert ran.code == 0, ran.err
    assert torques(bench) == [1, 1, 1]
    assert [bench.simulations["arm"][node].memory["present_position"] for node in (1, 2, 3)] == [2048] * 3


def test_a_dry_run_of_hold_only_reads(bench: Bench, run: Run) -> None:
    assert run("loop-stats", "arm", "--rate", "100", "--seconds", "1", "--hold", "--dry-run").code == 0
    assert torques(bench) == [0, 0, 0]


def test_a_person_sees_each_bus(bench: Bench, run: Run) -> None:
    ran = run("loop-stats", "a1", "c1", "--rate", "50", "--seconds", "1")
    assert ran.code == 0, ran.err
    assert [line.split()[0] for line in ran.out.splitlines()[1:4]] == ["bus", "arm", "can"]
    assert "50.0 of 50 cycles per second, 51 in 1.00 s: 0 overruns, 0 slots skipped" in ran.out
    assert "readings lost: none" in ran.out


def test_readings_that_are_lost_are_counted_and_end_with_6(
    bench: Bench, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    a2 = bench.simulations["arm"][2]
    bench.at_request(monkeypatch, {30: a2.unplug, 32: a2.plug})
    ran = run("loop-stats", "arm", "--rate", "5", "--seconds", "8", "--json")
    assert ran.code == 6, ran.err
    assert set(ran.document["lost"]) == {"a2"}
    assert ran.document["lost"]["a2"] > 0
    assert "readings lost: a2" in ran.err


def test_one_that_stays_silent_ends_it_with_5(
    bench: Bench, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.at_request(monkeypatch, {60: bench.simulations["arm"][2].unplug})
    ran = run("loop-stats", "arm", "--rate", "50", "--seconds", "3")
    assert ran.code == 5
    assert "a2" in ran.err


@pytest.mark.parametrize(
    "words",
    [
        ("nobody",),
        ("lift",),
        ("arm", "--rate", "-1"),
        ("arm", "--rate", "nan"),
        ("arm", "--seconds", "0"),
        ("arm", "--seconds", "long"),
    ],
    ids=" ".join,
)
def test_what_is_no_loop_ends_with_2(words: tuple[str, ...], bench: Bench, run: Run) -> None:
    ran = run("loop-stats", *words)
    assert (ran.code, ran.out) == (2, ""), ran.err
    assert torques(bench) == [0, 0, 0]


def test_without_hold_there_is_nothing_to_rehearse(bench: Bench, run: Run) -> None:
    ran = run("loop-stats", "arm", "--dry-run")
    assert (ran.code, ran.out) == (2, "")
    assert "--hold with --dry-run" in ran.err
    assert "would send" in run("loop-stats", "arm", "--dry-run", "--hold").out
