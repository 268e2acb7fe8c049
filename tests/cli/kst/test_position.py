"""Positions as the manual has them, to the count; a status that is not explained; a version that is text."""

from __future__ import annotations

from math import radians

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def goal(servos: Simulation) -> int:
    return int(servos[37].memory["goal_position"])


@pytest.mark.parametrize(
    ("said", "raw"),
    [
        ("10.9deg", 109),
        ("10.85deg", 109),
        ("-10.85deg", -109),
        ("-0.8deg", -8),
        ("90deg", 900),
        ("-0.5", -286),
    ],
)
def test_a_position_is_sent_as_decimals_are_rounded(
    said: str, raw: int, servos: Simulation, run: Run
) -> None:
    ran = run("kst", "position", f"{servos.url}#37", said, "--json")
    assert ran.code == 0, ran.err
    assert ran.document["schema"] == "motorbus.kst.position/1"
    assert goal(servos) == raw


def test_it_waits_when_told_to(servos: Simulation, run: Run) -> None:
    assert run("kst", "position", f"{servos.url}#37", "30deg", "--wait").code == 0
    ran = run("kst", "position", f"{servos.url}#37", "--json")
    assert ran.document["position"] == pytest.approx(radians(30), abs=0.02)


@pytest.mark.parametrize("said", ["200deg", "-90.05deg", "90.06deg"])
def test_beyond_the_range_is_unsafe_and_nothing_is_sent(said: str, servos: Simulation, run: Run) -> None:
    for words in (["kst", "position", f"{servos.url}#37", said], ["move", f"{servos.url}#37={said}"]):
        ran = run(*words, "-vv")
        assert (ran.code, ran.out) == (8, "")
        assert "out of range" in ran.err
        assert "625#22" not in ran.err
    assert goal(servos) == 0


@pytest.mark.parametrize("said", ["nan", "inf", "far", "10kg"])
def test_what_is_no_angle_is_no_order(said: str, servos: Simulation, run: Run) -> None:
    assert run("kst", "position", f"{servos.url}#37", said).code == 2
    assert goal(servos) == 0


def test_a_long_way_needs_consent(newer: Simulation, run: Run) -> None:
    bus = f"{newer.url}#37"
    assert run("kst", "position", bus, "-95deg", "--wait").code == 0
    assert run("kst", "position", bus, "95deg").code == 8
    assert newer[37].memory["goal_position"] == -950
    assert run("kst", "position", bus, "95deg", "--yes").code == 0
    assert newer[37].memory["goal_position"] == 950


def test_a_dry_run_shows_the_frame_of_the_manual(servos: Simulation, run: Run) -> None:
    ran = run("kst", "position", f"{servos.url}#37", "90deg", "--dry-run", "--json")
    assert [one["frame"] for one in ran.document["withheld"]] == ["625#2203600084030000"]
    assert goal(servos) == 0


def test_the_manuals_status_is_two_bytes_and_a_warning(servos: Simulation, run: Run) -> None:
    ran = run("kst", "status", f"{servos.url}#37", "--json")
    assert (ran.document["x1"], ran.document["x2"]) == (0, 0)
    assert "may be returning the position" in ran.document["warning"]
    assert "may be returning the position" in run("kst", "status", f"{servos.url}#37").err


def test_newer_firmware_tells_current_and_temperature(newer: Simulation, run: Run) -> None:
    document = run("kst", "status", f"{newer.url}#37", "--json").document
    assert document["temperature"] == 25
    assert "A" in run("kst", "status", f"{newer.url}#37").out


def test_the_version_is_text(servos: Simulation, run: Run) -> None:
    assert run("kst", "version", f"{servos.url}#37", "--json").document["version"] == "1.00"


def test_the_profile_is_a_flag_too(run: Run) -> None:
    ran = run("kst", "position", "kst:sim,ids=1#1", "40deg", "--profile", "xqpower", "--dry-run", "--json")
    assert [one["frame"] for one in ran.document["withheld"]][-1] == "601#22036000D0020000"
