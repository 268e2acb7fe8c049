"""Alarms in words wherever they are told, with the figures behind them."""

from __future__ import annotations

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

SAID = "voltage: supply 12.1 V above limit 8.0 V"


def test_info_says_what_an_alarm_means(run: Run, arm: Simulation) -> None:
    assert run("info", f"{arm.url}#2", "--json").document["alarms"] == []
    arm[2].voltage = 12.1
    assert SAID in run("info", f"{arm.url}#2", "--json").document["alarms"][0]
    assert SAID in run("info", f"{arm.url}#2").out


def test_monitor_says_it_once(run: Run, arm: Simulation) -> None:
    arm[2].voltage = 12.1
    ran = run("monitor", f"{arm.url}#1-3", "--count", "3")
    assert ran.code == 0
    assert ran.err.count(SAID) == 1
    assert f"warning: {arm.url}#2: " in ran.err


def test_a_family_without_words_for_its_alarms_has_none(run: Run) -> None:
    assert run("info", "kst:sim,ids=1#1", "--json").document["alarms"] == []
