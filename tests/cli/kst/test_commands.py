"""The commands `motorbus kst ...`, judged by their output and by the memory of the simulated servo."""

from __future__ import annotations

from math import radians

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_set_id_verifies_after_the_power_cycle(run: Run) -> None:
    with motorbus.simulate("kst", ids="0x25+0x26", faults="at 9 s: power-cycle 37") as servos:
        ran = run("set-id", f"{servos.url}#0x25", "0x27", "--yes")
        assert ran.code == 0, ran.err
        assert "switch the supply of this servo off and on again now" in ran.err
        assert [one["id"] for one in run("scan", servos.url, "--json").document["devices"]] == [38, 39]


def test_set_baud_resumes_after_a_timeout(run: Run) -> None:
    with motorbus.simulate("kst", ids="0x25") as servos:
        words = ["set-baud", f"{servos.url}#37", "1000000", "--yes", "--timeout", "1s"]
        ran = run(*words)
        assert ran.code == 1
        assert "did not come back within 1 s" in ran.err
        servos[37].power_cycle()
        ran = run(*words)
        assert ran.code == 0, ran.err
        assert servos[37].bit_rate == 1_000_000


def test_limits_are_saved_and_bound_the_next_move(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("write", device, "negative_limit=-45deg", "positive_limit=30deg", "--yes").code == 0
    newer[37].power_cycle()
    rows = run("read", device, "negative_limit", "positive_limit", "--json").document["registers"]
    assert [row["value"] for row in rows] == pytest.approx([radians(-45), radians(30)])
    assert run("move", f"{device}=40deg").code == 8


def test_reverse_changes_only_its_bit(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    before = newer[37].memory["function_enable"]
    assert run("kst", "reverse", device, "--json").document["reversed"] is False
    assert "in reverse" in run("kst", "reverse", device, "on", "--yes").out
    assert newer[37].memory["function_enable"] == before | 0x20
    assert run("kst", "reverse", device, "--json").document["reversed"] is True


def test_mid_point_sets_the_zero_here(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("move", f"{device}=20deg").code == 0
    shown = run("kst", "mid-point", device, "--dry-run", "--json").document["withheld"]
    assert [one["frame"][:12] for one in shown] == ["625#22093000", "625#22101001"]
    assert newer[37].memory["present_position"] == 200
    document = run("kst", "mid-point", device, "--yes", "--json").document
    assert document["position"] == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize(
    ("words", "frames"),
    [
        ("move BUS=90deg", ["625#2203600084030000"]),
        ("move BUS=40deg --profile xqpower", ["000#0125", "625#22036000D0020000"]),
    ],
)
def test_dry_run_shows_the_frames_of_the_manual_and_sends_none(
    words: str, frames: list[str], servos: Simulation, run: Run
) -> None:
    before = dict(servos[37].memory)
    ran = run(*words.replace("BUS", f"{servos.url}#37").split(), "--dry-run", "--json")
    assert [one["frame"] for one in ran.document["withheld"]] == frames
    assert dict(servos[37].memory) == before
