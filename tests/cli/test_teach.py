"""Teaching: axes are let go, led, and what was seen stands in a file that is replayed as it was taught."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from motorbus.motion.trajectory import Trajectory
from tests.cli.conftest import Bench, Run

HELD, LIMP = 1, 0


def torques(bench: Bench) -> list[int]:
    return [bench.simulations["arm"][node].memory["torque_enable"] for node in (1, 2, 3)]


def test_what_was_taught_stands_in_the_file(bench: Bench, run: Run) -> None:
    assert run("move", "a1=20deg", "a2=-10deg").code == 0
    ran = run("teach", "a1", "a2", "--output", "wave.csv", "--seconds", "2", "--rate", "20")
    assert ran.code == 0, ran.err
    assert "2.00 s, 41 samples in wave.csv" in ran.out
    assert "hold what could sag" in ran.err
    taught = Trajectory.load("wave.csv", bench.machine.axes)
    assert list(taught.axes) == ["a1", "a2"]
    assert len(taught.times) == 41
    assert taught.duration == pytest.approx(2.0)
    assert taught.axes["a1"][0] == pytest.approx(0.349, abs=0.01)


def test_only_those_who_are_taught_are_let_go(bench: Bench, run: Run) -> None:
    assert run("hold", "arm").code == 0
    assert torques(bench) == [HELD, HELD, HELD]
    assert run("teach", "a1", "a2", "--output", "wave.csv", "--seconds", "1").code == 0
    assert torques(bench) == [LIMP, LIMP, HELD]


def test_no_limp_switches_nothing(bench: Bench, run: Run) -> None:
    assert run("hold", "arm").code == 0
    ran = run("teach", "arm", "can", "--output", "wave.csv", "--seconds", "1", "--no-limp", "--json")
    assert ran.code == 0, ran.err
    assert torques(bench) == [HELD, HELD, HELD]
    assert [one["name"] for one in ran.document["axes"]] == ["a1", "a2", "a3", "c1"]
    assert (ran.document["schema"], ran.document["samples"]) == ("motorbus.teach/1", 51)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 10)])
def test_a_signal_ends_it_and_what_was_taught_is_kept(
    number: signal.Signals, code: int, bench: Bench, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.at_request(monkeypatch, {60: lambda: signal.raise_signal(number)})
    ran = run("teach", "arm", "--output", "wave.csv")
    assert ran.code == code, ran.err
    assert 2 < len(Trajectory.load("wave.csv").times) < 60


def test_what_was_recorded_until_an_axis_fell_silent_is_kept(
    bench: Bench, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.at_request(monkeypatch, {60: bench.simulations["arm"][2].unplug})
    ran = run("teach", "a1", "a2", "--output", "wave.csv", "--smooth", "5")
    assert (ran.code, ran.out) == (5, ""), ran.err
    taught = Trajectory.load("wave.csv", bench.machine.axes)
    assert len(taught.times) > 20
    assert f"kept {taught.duration:.2f} s, {len(taught.times)} samples until then, in wave.csv" in ran.err


def test_a_dry_run_lets_nobody_go_and_writes_nothing(bench: Bench, run: Run) -> None:
    assert run("hold", "arm").code == 0
    ran = run("teach", "a1", "can", "--output", "wave.csv", "--dry-run")
    assert ran.code == 0, ran.err
    assert "would be let go" in ran.out
    assert "stays as it is" in ran.out
    assert torques(bench) == [HELD, HELD, HELD]
    assert not Path("wave.csv").exists()


def test_a_file_is_replaced_only_when_somebody_agrees(bench: Bench, run: Run) -> None:
    Path("wave.csv").write_text("precious", encoding="utf-8")
    words = ("teach", "a1", "--output", "wave.csv", "--seconds", "1")
    assert run(*words).code == 8
    assert Path("wave.csv").read_text(encoding="utf-8") == "precious"
    assert run(*words, "--yes", "--smooth", "5").code == 0
    assert Trajectory.load("wave.csv").duration == pytest.approx(1.0)


@pytest.mark.parametrize(
    "words",
    [
        ("nobody", "--output", "w.csv"),
        ("a1", "--output", "no/such/folder/w.csv"),
        ("a1", "--output", "."),
        ("a1",),
        ("a1", "--output", "w.csv", "--seconds", "0"),
        ("a1", "--output", "w.csv", "--seconds", "soon"),
        ("a1", "--output", "w.csv", "--rate", "0"),
        ("a1", "--output", "w.csv", "--rate", "nan"),
        ("a1", "--output", "w.csv", "--smooth", "-1"),
        ("c1", "--output", "w.csv", "--seconds", "1"),
        ("lift", "--output", "w.csv", "--seconds", "1"),
    ],
    ids=" ".join,
)
def test_what_cannot_be_taught_ends_with_2_and_lets_nobody_go(
    words: tuple[str, ...], bench: Bench, run: Run
) -> None:
    assert run("hold", "arm").code == 0
    ran = run("teach", *words)
    assert (ran.code, ran.out) == (2, ""), ran.err
    assert "error: " in ran.err
    assert "the torque goes off now" not in ran.err
    assert "has train" not in ran.err
    assert torques(bench) == [HELD, HELD, HELD]
    assert not Path("w.csv").exists()
