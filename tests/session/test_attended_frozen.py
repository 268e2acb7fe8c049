"""A process that is frozen as a whole stops nothing; when it goes on it finds its lease lost, and stops first.

One that is killed cannot even do that: what turns without an end goes on turning. Both are said in the docs, and that
they are so is why somebody has to attend.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from motorbus.cli.simulated import Simulated
from tests.session.test_robot_signals_ports import LOOKS, status
from tests.support.machines import described

PROGRAM = """
import sys, threading
from motorbus import Robot
from motorbus.link import usb_adapters

usb_adapters.TERMINAL_LATENCY = 1.0  # whoever answers may have to wait for a processor
with Robot.load(sys.argv[1]) as robot:
    wheel = robot["a1"].device
    wheel.set_mode("velocity")
    wheel.enable_torque()
    with robot.attended(lasts=2.0) as hand:
        wheel.set_velocity(1.5)
        print("ready", flush=True)
        while True:
            hand.beat()
            threading.Event().wait(0.02)
"""


def place(control: Path) -> int:
    return int(status(control)[0]["raw_position"])


def goes_on(control: Path, counts: int) -> bool:
    """Whether it is seen to turn by so many counts."""
    last, gone = place(control), 0
    for _ in range(LOOKS):
        here = place(control)
        gone += (here - last) % 4096
        last = here
        if gone >= counts:
            return True
    return False


def rests(control: Path) -> bool:
    return any(not status(control)[0]["moving"] for _ in range(LOOKS))


@pytest.mark.parametrize("how", ["frozen", "killed"])
def test_l15_d15_what_a_process_that_does_nothing_any_more_leaves_behind(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    control = tmp_path / "control"
    with Simulated("feetech", ids="1", link=tmp_path / "arm", control=str(control)) as simulated:
        file = tmp_path / "motorbus.toml"
        file.write_text(described({"arm": simulated.bus}, "1", "", False, {}, {}), encoding="utf-8")
        with subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(file)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as program:
            assert program.stdout is not None
            assert program.stdout.readline() == "ready\n"
            program.send_signal(signal.SIGSTOP if how == "frozen" else signal.SIGKILL)
            assert goes_on(control, 4096), "about 4 s at 1.5 rad/s: twice as long as the lease lasts"
            if how == "frozen":
                program.send_signal(signal.SIGCONT)
            _, said = program.communicate(timeout=120)
        if how == "frozen":
            assert (program.returncode, rests(control)) == (1, True)
            assert "the lease of this machine was lost" in said
        else:
            assert goes_on(control, 512)
