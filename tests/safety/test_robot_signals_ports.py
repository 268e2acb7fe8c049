"""A program on a real port of each family that gets signals in the middle of a motion."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.machines import file_text
from tests.support.processes import Simulated

PROGRAM = """
import sys
from motorbus import Robot
from motorbus.link import usb_adapters

usb_adapters.TERMINAL_LATENCY = 1.0  # whoever answers may have to wait for a processor
with Robot.load(sys.argv[1]) as robot:
    if "lift" in robot.axes:
        robot.set_position("lift", 0.0)
        print("ready", flush=True)
        robot.jog("lift", 0.003, 60.0)
    else:
        robot.enable_torque()
        print("ready", flush=True)
        ways = {"a1": 2.0, "a2": -2.0, "c1": 0.8}
        robot.move({name: ways[name] for name in robot.axes}, duration=60.0)
"""
LOOKS = 100_000


def status(control: Path) -> list[dict[str, Any]]:
    """How the simulated devices of a bus are by now."""
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(control))
        client.sendall(b"status\n")
        nodes: list[dict[str, Any]] = json.loads(client.makefile().readline())["nodes"]
    return nodes


def ended(file: Path, *signals: signal.Signals) -> int:
    """How the program ends that gets these signals, once it is about to move."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
        for one in signals:
            program.send_signal(one)
        program.communicate(timeout=120)
    return program.returncode


@pytest.mark.parametrize(("family", "bus"), [("feetech", "arm"), ("kst", "can"), ("stepper", "stage")])
@pytest.mark.parametrize(
    ("signals", "code"),
    [
        ((signal.SIGTERM,), 143),
        ((signal.SIGHUP,), 129),
        ((signal.SIGINT, signal.SIGINT), -signal.SIGINT),
        ((signal.SIGTERM, signal.SIGTERM), 143),
    ],
)
def test_it_leaves_its_machine_as_the_file_says(
    family: str,
    bus: str,
    signals: tuple[signal.Signals, ...],
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    control = tmp_path / "control"
    ids = {"arm": "1-2", "can": "0x25"}
    with Simulated(family, link=tmp_path / bus, control=str(control), ids=ids.get(bus, "1")) as simulated:
        file = tmp_path / "motorbus.toml"
        there = {"arm": "", "can": "", **({bus: ids[bus]} if bus in ids else {})}
        axes = {"a1": {"exit": "torque_off"}, "a2": {"exit": "hold"}}
        text = file_text(
            {bus: simulated.bus}, there["arm"], there["can"], bus == "stage", axes=axes, exit="hold"
        )
        file.write_text(text, encoding="utf-8")
        assert ended(file, *signals) == code
        for _ in range(LOOKS):
            found = status(control)
            if not any(one.get("moving") or one.get("frequency") for one in found):
                break
        else:
            pytest.fail("something goes on and on")
        if family == "feetech":
            assert [one["torque_enabled"] for one in found] == [False, True]
