"""Common commands on CAN servos: emergency stop, scan, and what they show of this family."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.errors import OutcomeUnknown
from motorbus.families.kst.cli import move_together
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run
from tests.families.kst.bench import Bench


@pytest.mark.parametrize(("which", "silent"), [("", []), ("#37+38", []), ("#37+38", [38])])
def test_estop_holds_moving_servos_and_names_silent_ones(
    which: str, silent: list[int], servos: Simulation, run: Run
) -> None:
    with motorbus.open(servos.url) as bus:
        motorbus.kst.Servo(bus, 37).move(1.5, wait=False)
    for node in silent:
        servos[node].unplug()
    ran = run("estop", f"{servos.url}{which}", "--json", "-vv")
    assert ran.code == (6 if silent else 0)
    (stop,) = ran.document["buses"]
    assert (stop["acknowledged"], stop["silent"]) == ([37] if silent else [37, 38], silent)
    assert "no way to switch its torque off" in stop["promise"]
    assert 0 <= servos[37].memory["goal_position"] < 859
    assert ("tx 600#" in ran.err) is not bool(which)  # a broadcast costs time; named ids need none


def test_read_shows_versions_and_status_in_words(servos: Simulation, newer: Simulation, run: Run) -> None:
    rows = run("read", f"{servos.url}#37", "firmware_version", "node_id", "--json").document["registers"]
    assert [(row["name"], row["meaning"]) for row in rows] == [("firmware_version", "V1.2"), ("node_id", "")]
    (row,) = run("read", f"{newer.url}#37", "status", "--json").document["registers"]
    assert row["meaning"] == "0.000 A, 25 °C"


def test_move_of_several_stops_all_when_the_first_does_not_answer() -> None:
    with Bench(5, 6, position=100) as bench:
        bench[5].unplug()
        with pytest.raises(OutcomeUnknown):
            move_together(bench.bus, {5: 0.5, 6: -0.5})
        assert bench[6].memory["goal_position"] == 100
