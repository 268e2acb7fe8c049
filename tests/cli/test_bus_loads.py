"""The load of serial buses and of machines: a row for each bus, exit code 1 where it does not fit, nothing opened."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Bench, Run

ARM = "feetech:/dev/not-there"


def test_a_serial_bus_is_counted_without_its_port(run: Run) -> None:
    ran = run("budget", ARM, "--ids", "1-6", "--rate", "200", "--json")
    assert ran.code == 0, ran.err
    told = ran.document
    (bus,) = told["buses"]
    assert (told["schema"], told["fits"], told["slowest"]) == ("motorbus.budget.loop/1", True, ARM)
    assert (bus["rate"], bus["exchanges"], bus["replies"]) == (1_000_000, 2, 6)
    assert bus["axes"] == ["1", "2", "3", "4", "5", "6"]
    assert told["highest_rate"] == pytest.approx(1136, rel=0.001)
    assert bus["goals"] + bus["readings"] == pytest.approx(bus["wire"])
    assert bus["load"] == pytest.approx(200 * bus["wire"])


def test_the_rate_of_the_bus_counts_as_option_and_as_flag(run: Run) -> None:
    fast = run("budget", f"{ARM}#1-6", "--json").document["highest_rate"]
    for words in ([f"{ARM},baud=500000#1-6"], [f"{ARM}#1-6", "--baud", "500k"]):
        assert run("budget", *words, "--json").document["highest_rate"] == pytest.approx(fast / 2, rel=0.05)


def test_the_model_decides_what_is_sent(run: Run) -> None:
    group = run("budget", ARM, "--ids", "1-3", "--json").document["buses"][0]
    single = run("budget", ARM, "--ids", "1-3", "--model", "scs0009", "--json").document["buses"][0]
    assert group["exchanges"] == 2
    assert single["exchanges"] == 4  # it knows no packet that asks several


def test_what_devices_think_counts_on_one_lane(run: Run) -> None:
    quick = run("budget", ARM, "--ids", "1-6").out
    ran = run("budget", ARM, "--ids", "1-6", "--turnaround", "0.5ms")
    assert "think" not in quick
    assert "% of each cycle is time in which devices think" in ran.out


def test_what_does_not_fit_ends_with_1(run: Run) -> None:
    ran = run("budget", ARM, "--ids", "1-6", "--rate", "1200")
    assert ran.code == 1
    assert "load at 1200 Hz" in ran.out
    assert "a loop of 1200 Hz does not fit" in ran.err


def test_a_machine_is_counted_bus_by_bus(bench: Bench, run: Run) -> None:
    for words in ((), ("motorbus.toml",)):
        ran = run("budget", *words, "--rate", "100", "--json")
        assert ran.code == 0, ran.err
        told = ran.document
        assert [(one["bus"], one["axes"]) for one in told["buses"]] == [
            ("arm", ["a1", "a2", "a3"]),
            ("can", ["c1"]),
        ]
        assert told["without"] == ["lift"]
        assert told["slowest"] == "can"


def test_names_choose_what_is_counted(bench: Bench, run: Run) -> None:
    ran = run("budget", "a1", "c1", "--json")
    assert [one["axes"] for one in ran.document["buses"]] == [["a1"], ["c1"]]
    assert "lift" not in ran.err


def test_nothing_is_sent_to_the_machine(bench: Bench, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for one in bench.simulations.values():
        monkeypatch.setattr(one.simulator, "receive", None)
    assert run("budget").code == 0


@pytest.mark.parametrize(
    "words",
    [
        (ARM,),
        (ARM, "--ids", "0-400"),
        (ARM, "--ids", "x"),
        (ARM, "--ids", "1", "--model", "abacus"),
        (ARM, "--ids", "1", "--rate", "-1"),
        (ARM, "--ids", "1", "--rate", "nan"),
        (ARM, "--ids", "1", "--turnaround", "-1ms"),
        (ARM, "--ids", "1", "--loop", "read"),
        (ARM, "--ids", "1", "--latency", "1ms"),
        (ARM, "--ids", "1", "--reports", "10ms"),
        (ARM, "--ids", "1", "--colour", "red"),
        (ARM, "feetech:sim", "--ids", "1"),
        ("stepper:/dev/not-there",),
        ("lift",),
        ("nobody",),
        ("a1", "--ids", "1"),
        ("a1", "--model", "sts3215"),
        ("no-such.toml",),
    ],
    ids=" ".join,
)
def test_what_cannot_be_counted_ends_with_2(words: tuple[str, ...], bench: Bench, run: Run) -> None:
    ran = run("budget", *words)
    assert (ran.code, ran.out) == (2, ""), ran.err
    assert "error: " in ran.err


def test_without_a_machine_file_and_without_a_bus_it_says_what_is_missing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = run("budget")
    assert ran.code == 2
    assert "there is no machine file" in ran.err
