"""A program with a robot that gets SIGINT, SIGTERM or SIGHUP from outside in the middle of a move of ten axes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
from threading import Event, Thread
import motorbus
from tests.support.machines import machine

real = {bus: {"clock": "real"} for bus in ("arm", "can", "stage")}
with machine("1-6", "0x25-0x27", lift=True, exit="torque_off", options=real,
             axes={name: {"exit": "hold"} for name in ("c1", "c2", "c3", "lift")}) as (config, sims):
    try:
        with motorbus.Robot(config) as robot:
            robot.set_position("lift", 0.0)
            robot.enable_torque()
            def report():
                while not all(axis.status.moving for axis in robot.axes.values()):
                    Event().wait(0.001)
                print("ready", flush=True)
            Thread(target=report, daemon=True).start()
            goals = {name: 2.0 if name in config.groups["upper"] else 0.8 for name in config.groups["led"]}
            robot.move({**goals, "lift": 0.2}, duration=60.0)
    except (KeyboardInterrupt, SystemExit) as error:
        notes = " ".join(getattr(error, "__notes__", ()))
        named = sum(f"{name}:" in notes for name in config.axes)
        print("interrupted", getattr(error, "code", ""), named)
    print([sims["arm"][node].memory["torque_enable"] for node in range(1, 7)])
    lift = sims["stage"][1]
    print(lift.machine.motion is None and lift.store.working == lift.store.stored[1])
    print(all(sims["can"][node].raw_position < 300 for node in (0x25, 0x26, 0x27)))
"""
LEFT = "[0, 0, 0, 0, 0, 0]\nTrue\nTrue"


def told(program: str, *signals: signal.Signals) -> str:
    """The output of such a program after `ready`, when it gets these signals one after the other."""
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


@pytest.mark.parametrize(
    ("signals", "code"),
    [
        ([signal.SIGINT], ""),
        ([signal.SIGINT] * 3, ""),
        ([signal.SIGTERM], 143),
        ([signal.SIGHUP], 129),
        ([signal.SIGTERM] * 3, 143),
    ],
)
def test_a_signal_stops_ten_axes_in_the_middle_of_a_move(signals: list[signal.Signals], code: object) -> None:
    """Each axis is left as the machine file says; the error names each axis that was moving."""
    first, *rest = told(PROGRAM, *signals).splitlines()
    assert "\n".join(rest) == LEFT
    assert first.startswith(f"interrupted {code} ")
    assert len(signals) > 1 or first.endswith(" 10")


def test_sigterm_while_ctrl_c_is_handled_skips_no_stop() -> None:
    first, *rest = told(PROGRAM, signal.SIGINT, signal.SIGTERM).splitlines()
    assert "\n".join(rest) == LEFT
    assert first.startswith("interrupted")
