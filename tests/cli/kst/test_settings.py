"""What newer firmware lets one set, and that the manual's profile refuses it."""

from __future__ import annotations

from math import radians

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_limits_are_set_and_saved(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "limits", device, "-45deg", "30deg", "--yes").code == 0
    newer[37].power_cycle()
    document = run("kst", "limits", device, "--json").document
    assert (document["low"], document["high"]) == pytest.approx((radians(-45), radians(30)))
    assert run("kst", "position", device, "40deg").code == 8


def test_one_limit_alone_is_no_order(newer: Simulation, run: Run) -> None:
    assert run("kst", "limits", f"{newer.url}#37", "-45deg", "--yes").code == 2


def test_the_sense_is_turned_and_only_its_bit(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    before = newer[37].memory["function_enable"]
    assert run("kst", "reverse", device, "--json").document["reversed"] is False
    assert run("kst", "reverse", device, "on", "--yes").code == 0
    assert newer[37].memory["function_enable"] == before | 0x20
    assert run("kst", "reverse", device, "--json").document["reversed"] is True
    assert "in reverse" in run("kst", "reverse", device).out


def test_the_mid_point_is_here(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "position", device, "20deg", "--wait").code == 0
    document = run("kst", "mid-point", device, "--yes", "--json").document
    assert document["position"] == pytest.approx(0, abs=0.01)


def test_reports_begin_and_end(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "reports", "on", device, "--interval", "20ms", "--json").document["interval"] == 0.02
    assert newer[37].memory["report_interval"] == 20
    assert newer.simulator.due() is not None
    assert run("kst", "reports", "off", device).code == 0
    assert newer.simulator.due() is None


@pytest.mark.parametrize("words", ["limits -1 1", "reverse on", "mid-point"])
def test_without_consent_nothing_is_written(words: str, newer: Simulation, run: Run) -> None:
    command, *values = words.split()
    ran = run("kst", command, f"{newer.url}#37", *values, "-vv")
    assert ran.code == 8
    assert " tx 625#22" not in ran.err  # a write; what it depends on may be read
    assert "nothing was changed" in ran.err


@pytest.mark.parametrize("words", ["limits BUS", "reverse BUS", "mid-point BUS --yes", "reports on BUS"])
def test_the_manual_has_none_of_it(words: str, servos: Simulation, run: Run) -> None:
    ran = run("kst", *words.replace("BUS", f"{servos.url}#37").split(), "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert "profile" in ran.err
    assert " tx " not in ran.err
