"""Common commands on CAN servos: emergency stop, scan, budget, and what they show of this family."""

from __future__ import annotations

import subprocess
import sys

import pytest

import motorbus
from motorbus import families
from motorbus.cli import faces
from motorbus.cli.simulated import Simulated
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

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


def test_estop_stops_another_process(on_slcan: Simulated, run: Run) -> None:
    command = [sys.executable, "-c", MOVING, on_slcan.bus]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        (stop,) = run("estop", on_slcan.bus, "--json").document["buses"]
        _, err = process.communicate(timeout=30)
    assert (stop["acknowledged"], str(process.pid) in stop["by"]) == ([37], True)
    assert "Interrupted" in err


def test_scan_skips_rates_that_the_adapter_lacks(on_slcan: Simulated, run: Run) -> None:
    ran = run("scan", on_slcan.bus, "--ids", "37-38", "--bitrate", "all", "--json")
    assert ran.code == 0, ran.err
    assert [(one["id"], one["bitrate"]) for one in ran.document["devices"]] == [(37, 500_000), (38, 500_000)]
    assert "nothing was sent at 800000 bit/s" in ran.err
    silent = run("read", f"{on_slcan.bus},bitrate=250000#37")
    assert silent.code == 5
    assert "--bitrate all" in silent.err


def test_read_shows_versions_and_status_in_words(servos: Simulation, newer: Simulation, run: Run) -> None:
    rows = run("read", f"{servos.url}#37", "firmware_version", "node_id", "--json").document["registers"]
    assert [(row["name"], row["meaning"]) for row in rows] == [("firmware_version", "1.00"), ("node_id", "")]
    (row,) = run("read", f"{newer.url}#37", "status", "--json").document["registers"]
    assert row["meaning"] == "0.000 A, 25 °C"


def test_budget_counts_every_position_in_the_form_of_the_bus() -> None:
    family = families.load("kst").open(profile="kst-ext")
    frames = faces.offer("kst", "budget_frames")(family, 0x25)
    (goals, acknowledgements), (requests, replies) = frames["write"], frames["read"]
    assert [str(goals[0]), str(goals[-1])] == ["625#2203600018FC0000", "625#22036000E8030000"]
    assert [str(acknowledgements[0]), str(requests[0])] == ["5A5#6003600000000000", "625#4002600000000000"]
    assert (len(goals), len(replies), str(replies[1000])) == (2001, 2001, "5A5#4B02600000000000")
    reports = faces.offer("kst", "report_frames")(family, 0x25)
    assert {(one.id, len(one.data)) for one in reports} == {(0x5A5, 4)}
    extended = families.load("kst").open(id_format="ext", sized="yes")
    goals, _ = faces.offer("kst", "budget_frames")(extended, 1)["write"]
    assert str(goals[0]) == "00000601#2B0360007CFC0000"
