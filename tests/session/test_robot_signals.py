"""A program with a robot that is interrupted from outside, as a person does it: by Ctrl-C, once or again and again."""

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
from tests.motion.machines import machine

real = {"arm": {"clock": "real"}, "can": {"clock": "real"}, "stage": {"clock": "real"}}
with machine(arm="1-3", can="0x25", lift=True, exit="torque_off", options=real,
             axes={"c1": {"exit": "hold"}, "lift": {"exit": "hold"}}) as (made, sims):
    try:
        with Robot.of(made) as robot:
            robot["lift"].declare(0.0)
            robot.enable_torque()
            print("ready", flush=True)
            robot.move({"a1": 2.0, "a2": -2.0, "c1": 0.8, "lift": 0.2}, duration=60.0)
    except KeyboardInterrupt:
        print("interrupted")
    torques = [sims["arm"][node].memory["torque_enable"] for node in (1, 2, 3)]
    turning = sims["stage"][1].status()["frequency"]
    print(f"torque {torques}, the lift turns at {turning:g} Hz")
"""


@pytest.mark.parametrize("times", [1, 3])
def test_an_interrupted_program_leaves_its_machine_as_the_file_says(times: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])},
        stdout=subprocess.PIPE,
        text=True,
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
        for _ in range(times):
            program.send_signal(signal.SIGINT)
        told, _ = program.communicate(timeout=60)
    assert told == "interrupted\ntorque [0, 0, 0], the lift turns at 0 Hz\n"
