"""The present pose gets another name, with consent; or the zero is shown as the device has it."""

from __future__ import annotations

import math

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_the_middle_needs_consent(run: Run, arm: Simulation) -> None:
    arm[3].raw_position = 1000
    ran = run("calibrate", f"{arm.url}#3")
    assert ran.code == 8
    assert "move the zero of #3 for good, and let it go limp" in ran.err
    assert arm[3].memory["homing_offset"] == 0
    document = run("calibrate", f"{arm.url}#3", "--yes", "--json").document
    assert document["schema"] == "motorbus.calibrate/1"
    assert (document["id"], document["raw_new_offset"]) == (3, -1048)
    assert document["after"] == pytest.approx(math.pi)
    assert arm[3].raw_position == 2048


def test_any_pose(run: Run, arm: Simulation) -> None:
    ran = run("calibrate", f"{arm.url}#3", "--to", "90deg", "--yes")
    assert ran.code == 0
    assert "#3 is calibrated (simulated)" in ran.out
    assert "1.5708 rad (90.0°)" in ran.out
    assert arm[3].memory["homing_offset"] == 1024


def test_what_is_not_as_asked_is_a_note(run: Run, arm: Simulation) -> None:
    arm[3].raw_position = 4095
    ran = run("calibrate", f"{arm.url}#3", "--to", str(2047 * math.tau / 4096), "--yes")
    assert ran.code == 0
    assert "note: this pose reads -1 count beside" in ran.err


def test_show_tells_where_the_zero_is(run: Run, arm: Simulation) -> None:
    assert run("calibrate", f"{arm.url}#3", "--to", "90deg", "--yes").code == 0
    document = run("calibrate", f"{arm.url}#3", "--show", "--json").document
    assert document["schema"] == "motorbus.calibrate.zero/1"
    assert (document["raw_offset"], document["position"]) == (1024, pytest.approx(math.pi / 2))
    assert document["limits"] == [0.0, pytest.approx(4095 * math.tau / 4096)]
    assert "0.0000 rad (0.0°) to 6.2817 rad (359.9°)" in run("calibrate", f"{arm.url}#3", "--show").out


def test_a_dry_run_shows_the_whole_sequence_and_changes_nothing(run: Run, arm: Simulation) -> None:
    for words in ([], ["--to", "1"]):
        ran = run("calibrate", f"{arm.url}#3", *words, "--dry-run", "--json")
        assert ran.code == 0, ran.err
        meanings = [one["meaning"] for one in ran.document["withheld"]]
        assert ["lock 0" in meanings[0], "torque_enable 0" in meanings[1]] == [True, True]
        assert "lock 1" in meanings[-1]
    assert arm[3].memory["homing_offset"] == 0


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("BUS#3 --to 400deg --yes", 2),
        ("BUS#3 --to nan --yes", 2),
        ("BUS#3 --show --to 1", 2),
        ("BUS#3 --show --dry-run", 2),
        ("BUS --yes", 2),
        ("BUS#9 --yes", 5),
        ("kst:sim,ids=1#1 --yes", 2),
        ("kst:sim,ids=1#1 --show", 2),
    ],
)
def test_what_is_impossible_changes_nothing(words: str, code: int, run: Run, arm: Simulation) -> None:
    ran = run("calibrate", *words.replace("BUS", arm.url).split())
    assert (ran.code, ran.out) == (code, ""), ran.err
    assert arm[3].memory["homing_offset"] == 0


def test_in_another_mode_there_is_advice(run: Run, arm: Simulation) -> None:
    assert run("feetech", "mode", f"{arm.url}#3", "velocity", "--yes").code == 0
    ran = run("calibrate", f"{arm.url}#3", "--yes")
    assert ran.code == 2
    assert "`motorbus feetech mode BUS#ID position`" in ran.err
