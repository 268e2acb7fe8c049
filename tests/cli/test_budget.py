"""What a loop would cost, by the exact frames of the family; nothing is opened, and nothing is sent."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Run

BUS = "kst:can://slcan/dev/not-there"


def test_no_port_is_needed(run: Run) -> None:
    ran = run("budget", BUS, "--ids", "1-16", "--rate", "50", "--json")
    assert ran.code == 0, ran.err
    document = ran.document
    assert document["schema"] == "motorbus.budget/1"
    assert (document["bitrate"], document["ids"], document["loop_rate"]) == (500_000, list(range(1, 17)), 50)
    assert len(document["transfers"]) == 32


def test_sixteen_servos_at_50_hz_take_39_percent_for_their_goals(run: Run) -> None:
    load = run("budget", BUS, "--ids", "1-16", "--rate", "50", "--loop", "write", "--json").document["load"]
    assert load["mean"] == pytest.approx(0.39, abs=0.005)
    assert load["least"] < load["mean"] < load["most"]


def test_a_read_is_242_to_243_bits_in_the_mean(run: Run) -> None:
    costs = run("budget", BUS, "--ids", "1-32", "--loop", "read", "--json").document["transfers"]
    means = [one["bits"]["mean"] for one in costs]
    assert sum(means) / len(means) == pytest.approx(243, abs=1)


def test_the_rate_of_the_bus_and_its_settings_count(run: Run) -> None:
    slow = run("budget", BUS, "--ids", "1", "--json").document
    fast = run("budget", f"{BUS},bitrate=1000000", "--ids", "1", "--json").document
    long = run("budget", f"{BUS}#1", "--id-format", "ext", "--bitrate", "1000000", "--json").document
    assert fast["highest_rate"]["mean"] == pytest.approx(2 * slow["highest_rate"]["mean"])
    assert long["bits"]["mean"] > fast["bits"]["mean"] + 60


def test_a_latency_decides_how_many_must_be_under_way(run: Run) -> None:
    words = [
        "budget",
        BUS,
        "--ids",
        "1",
        "--loop",
        "read",
        "--turnaround",
        "0.1ms",
        "--latency",
        "1ms",
        "--json",
    ]
    document = run(*words).document
    assert document["sequential_rate"] == pytest.approx(635, rel=0.02)
    assert document["in_flight"] == pytest.approx(3.3, abs=0.1)


def test_what_the_bus_cannot_carry_ends_with_1_and_is_told(run: Run) -> None:
    ran = run("budget", BUS, "--ids", "1-16", "--rate", "500")
    assert ran.code == 1
    assert "the bus cannot carry 500 Hz" in ran.err
    assert "load at 500 Hz" in ran.out


def test_reports_take_their_share(run: Run) -> None:
    document = run("budget", BUS, "--ids", "1-4", "--rate", "50", "--reports", "10ms", "--json").document
    assert document["besides"]["mean"] == pytest.approx(400 * 85 / 500_000, rel=0.05)
    assert "reports" in run("budget", BUS, "--ids", "1-4", "--reports", "10ms").out


@pytest.mark.parametrize(
    "words",
    [
        [BUS],
        [BUS, "--ids", "0"],
        [BUS, "--ids", "1-128"],
        [BUS, "--ids", "1", "--rate", "-1"],
        [BUS, "--ids", "1", "--rate", "nan"],
        [BUS, "--ids", "1", "--latency", "-1ms"],
        [BUS, "--ids", "1", "--reports", "0"],
        [BUS, "--ids", "1", "--profile", "acme"],
        [BUS, "--ids", "1", "--model", "kst-ext"],
        [BUS, "feetech:sim", "--ids", "1"],
    ],
    ids=" ".join,
)
def test_what_cannot_be_counted_ends_with_2(words: list[str], run: Run) -> None:
    ran = run("budget", *words)
    assert (ran.code, ran.out) == (2, "")
