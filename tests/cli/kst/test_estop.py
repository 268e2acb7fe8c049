"""The emergency stop of CAN servos: they hold where they are; who was only asked has not acknowledged it."""

from __future__ import annotations

import subprocess
import sys

import pytest

import motorbus
from motorbus.cli.simulated import Simulated
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run

MOVING = """
import sys, motorbus
with motorbus.open(sys.argv[1]) as bus:
    servo = motorbus.kst.Servo(bus, 37)
    print(servo.position(), flush=True)
    try:
        while True:
            for goal in (1.5, -1.5):
                servo.move(goal)
    except motorbus.errors.MotionError as error:
        print(type(error).__name__, flush=True)
"""


def under_way(servos: Simulation) -> float:
    """Servo 37 is on its way from 0 to 90 degrees; the moment, and where it is, are its own."""
    with motorbus.open(servos.url) as bus:
        servo = motorbus.kst.Servo(bus, 37)
        servo.move(1.5, wait=False)
        return float(servo.position())


@pytest.mark.parametrize("which", ["", "#37+38"])
def test_everybody_holds_where_he_is(which: str, servos: Simulation, run: Run) -> None:
    under_way(servos)
    (stop,) = run("estop", f"{servos.url}{which}", "--json").document["buses"]
    assert (stop["acknowledged"], stop["silent"]) == ([37, 38], [])
    assert "no way to switch its torque off" in stop["promise"]
    assert 0 <= servos[37].memory["goal_position"] < 859


def test_who_is_silent_is_told(servos: Simulation, run: Run) -> None:
    servos[38].unplug()
    ran = run("estop", f"{servos.url}#37+38", "--json")
    assert ran.code == 6
    (stop,) = ran.document["buses"]
    assert (stop["acknowledged"], stop["silent"]) == ([37], [38])


@pytest.mark.parametrize("named", [True, False])
def test_a_program_that_moves_is_stopped_from_another_shell(
    named: bool, on_slcan: Simulated, run: Run
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", MOVING, on_slcan.bus],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        (stop,) = run("estop", on_slcan.bus if named else "--all", "--json").document["buses"]
        out, err = process.communicate(timeout=30)
    assert stop["acknowledged"] == [37]
    assert str(process.pid) in stop["by"]
    assert "Interrupted" in out, err


def test_who_is_named_is_held_without_asking_who_is_there(run: Run) -> None:
    """The question to everyone waits for whoever may answer; an address with ids spares that time."""
    asks_everyone = "tx 600#"
    assert asks_everyone in run("estop", "kst:sim,ids=1-2", "-vv").err
    named = run("estop", "kst:sim,ids=1-2#1+2", "-vv")
    assert named.code == 0
    assert asks_everyone not in named.err
    assert "0.15 s" in run("estop", "--help").out
