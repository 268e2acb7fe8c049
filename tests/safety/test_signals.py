"""A program with a robot that is interrupted from outside: by Ctrl-C, by being told to end, by a terminal that goes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys
import motorbus
from motorbus import Robot
from tests.support.machines import machine

real = {"arm": {"clock": "real"}, "can": {"clock": "real"}, "stage": {"clock": "real"}}
with machine(arm="1-3", can="0x25", lift=True, exit="torque_off", options=real,
             axes={"c1": {"exit": "hold"}, "lift": {"exit": "hold"}}) as (made, sims):
    try:
        with Robot.of(made) as robot:
            robot["lift"].declare(0.0)
            robot.enable_torque()
            print("ready", flush=True)
            robot.move({"a1": 2.0, "a2": -2.0, "c1": 0.8, "lift": 0.2}, duration=60.0)
    except (KeyboardInterrupt, SystemExit) as error:
        print("interrupted", getattr(error, "code", ""))
    torques = [sims["arm"][node].memory["torque_enable"] for node in (1, 2, 3)]
    turning = sims["stage"][1].status()["frequency"]
    print(f"torque {torques}, the lift turns at {turning:g} Hz")
"""
LEFT = "torque [0, 0, 0], the lift turns at 0 Hz"


def told(program: str, *signals: signal.Signals) -> str:
    """What such a program says behind its first line, when it gets these signals, one after the other."""
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # else one of the tests' terminal that was ignored would be ignored here, too
    ) as running:
        assert running.stdout is not None
        assert running.stdout.readline() == "ready\n"
        for one in signals:
            running.send_signal(one)
        found, _ = running.communicate(timeout=120)
    return found


@pytest.mark.parametrize("times", [1, 3])
def test_an_interrupted_program_leaves_its_machine_as_the_file_says(times: int) -> None:
    assert told(PROGRAM, *[signal.SIGINT] * times) == f"interrupted \n{LEFT}\n"


@pytest.mark.parametrize(
    ("signals", "code"),
    [
        ([signal.SIGTERM], 143),
        ([signal.SIGHUP], 129),
        ([signal.SIGTERM, signal.SIGTERM, signal.SIGTERM], 143),
    ],
)
def test_so_does_one_that_is_told_to_end_or_loses_its_terminal(
    signals: list[signal.Signals], code: int
) -> None:
    assert told(PROGRAM, *signals) == f"interrupted {code}\n{LEFT}\n"


def test_being_told_to_end_while_ctrl_c_is_dealt_with_skips_no_stop() -> None:
    found = told(PROGRAM, signal.SIGINT, signal.SIGTERM)
    assert found.splitlines()[1] == LEFT
    assert found.startswith("interrupted")
