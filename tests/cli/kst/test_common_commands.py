"""Common commands on CAN servos: emergency stop, scan, and what they show of this family."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import motorbus
from motorbus.errors import LinkError, OutcomeUnknown
from motorbus.families.kst.cli import move_together
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run
from tests.families.kst.bench import Bench
from tests.support.processes import Simulated

MOVING = """import sys, motorbus
servo = motorbus.kst.Servo(motorbus.open(sys.argv[1]), 37)
print(servo.position(), flush=True)
while True: servo.move(1.5); servo.move(-1.5)"""


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


@pytest.mark.usefixtures("state_folder", "patient")
def test_estop_stops_another_process(tmp_path: Path, run: Run) -> None:
    with Simulated("kst", ids="0x25+0x26", link=tmp_path / "can") as simulated:
        command = [sys.executable, "-c", MOVING, simulated.bus]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline()
            (stop,) = run("estop", simulated.bus, "--json").document["buses"]
            _, err = process.communicate(timeout=30)
    assert (stop["acknowledged"], str(process.pid) in stop["by"]) == ([37], True)
    assert "Interrupted" in err


def test_scan_skips_rates_that_the_adapter_lacks(
    servos: Simulation, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tune(rate: int) -> None:
        if rate == 800_000:
            raise LinkError("this adapter has no such rate")
        set_rate(rate)

    set_rate = servos.simulator.tune
    monkeypatch.setattr(servos.simulator, "tune", tune)
    ran = run("scan", servos.url, "--ids", "37-38", "--bitrate", "all", "--json")
    assert ran.code == 0, ran.err
    assert [(one["id"], one["bitrate"]) for one in ran.document["devices"]] == [(37, 500_000), (38, 500_000)]
    assert "nothing was sent at 800000 bit/s" in ran.err
    silent = run("read", f"{servos.url},bitrate=250000#37")
    assert silent.code == 5
    assert "--bitrate all" in silent.err


def test_read_shows_versions_and_status_in_words(servos: Simulation, newer: Simulation, run: Run) -> None:
    rows = run("read", f"{servos.url}#37", "firmware_version", "node_id", "--json").document["registers"]
    assert [(row["name"], row["meaning"]) for row in rows] == [("firmware_version", "1.00"), ("node_id", "")]
    (row,) = run("read", f"{newer.url}#37", "status", "--json").document["registers"]
    assert row["meaning"] == "0.000 A, 25 °C"


def test_move_of_several_stops_all_when_the_first_does_not_answer() -> None:
    with Bench(5, 6) as bench:
        bench[6].raw_position = 100
        bench[5].unplug()
        with pytest.raises(OutcomeUnknown):
            move_together(bench.bus, {5: 0.5, 6: -0.5})
        assert bench[6].memory["goal_position"] == 100
