"""The commands `motorbus kst ...`, judged by their output and by the memory of the simulated servo."""

from __future__ import annotations

from math import radians

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_provision_reports_each_step_and_verifies_after_the_power_cycle(run: Run) -> None:
    with motorbus.simulate("kst", ids="0x25+0x26", faults="at 9 s: power-cycle 37") as servos:
        ran = run("kst", "provision", f"{servos.url}#0x25", "--new-id", "0x27", "--yes", "--json")
        assert ran.code == 0, ran.err
        assert {one["schema"] for one in ran.records} == {"motorbus.kst.provision/1"}
        events = [one for one in ran.records if one["event"] != "progress"]
        assert [one["event"] for one in events] == ["power-cycle", "provisioned"]
        assert (events[-1]["id"], events[-1]["from"], events[-1]["resumed"]) == (39, 37, False)
        assert "switch the supply of this servo off and on again now" in ran.err
        assert [one["id"] for one in run("scan", servos.url, "--json").document["devices"]] == [38, 39]


def test_provision_resumes_after_a_timeout(servos: Simulation, run: Run) -> None:
    words = ["kst", "provision", f"{servos.url}#37", "--new-id", "39", "--yes", "--timeout", "1s"]
    ran = run(*words)
    assert ran.code == 1
    assert "did not come back within 1 s" in ran.err
    servos[37].power_cycle()
    ran = run(*words)
    assert ran.code == 0, ran.err
    assert "#39 (0x27) had these values already: it answers at 500000 bit/s" in ran.out


def test_limits_are_saved_and_bound_the_next_move(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "limits", device, "-45deg", "30deg", "--yes").code == 0
    newer[37].power_cycle()
    document = run("kst", "limits", device, "--json").document
    assert (document["low"], document["high"]) == pytest.approx((radians(-45), radians(30)))
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
        (
            "kst provision BUS --new-id 39 --new-bitrate 1M",
            ["625#2200300027000000", "625#2201300007000000", "625#2210100173617665"],
        ),
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
