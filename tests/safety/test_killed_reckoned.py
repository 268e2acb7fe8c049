"""A program that is killed while a stepper axis moves: the motor ends the one move it was given, and rests.

In real processes, as in `test_kill`. The controller tells nothing of where it is, so the motor of the simulator is
asked. The killed program leaves word of each move before it orders it.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from motorbus.cli import main
from motorbus.core.request import Data
from motorbus.link.serial import SerialLink
from motorbus.session.robot import Robot
from tests.support.machines import described
from tests.support.processes import Simulated

PROGRAM = """
import os, signal, sys
from random import Random
from motorbus import Robot
from motorbus.link import usb_adapters
from motorbus.link.serial import SerialLink

usb_adapters.TERMINAL_LATENCY = 1.0  # whoever answers may have to wait for a processor
chance, left, write = Random(int(sys.argv[2])), [int(sys.argv[3])], SerialLink.write

def doomed(link, data):
    write(link, data)
    left[0] -= sys.argv[4] == "request" or data[2:4] == b"\\x03\\x0c"
    if left[0] < 0:
        os.kill(os.getpid(), signal.SIGKILL)

SerialLink.write = doomed
with Robot.load(sys.argv[1]) as robot:
    lift = robot["lift"]
    lift.declare(0.0)
    while True:
        way = chance.uniform(0.02, 0.04) * chance.choice((-1, 1))
        print(way, flush=True)
        lift.move_by(way)
"""
PULSE = 0.005 / 1600
"""m."""
ASKS = (0x3E, 0x00)
"""The third bytes of requests that only ask."""


def place(control: Path) -> tuple[float, bool]:
    """Where the motor is (m), and whether it moves."""
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(control))
        client.sendall(b"status\n")
        (node,) = json.loads(client.makefile().readline())["nodes"]
    return node["load"] * PULSE, node["phase"] != "idle"


def at_rest(control: Path) -> float:
    """Where it is once it does not move any more."""
    while True:
        found, moving = place(control)
        if not moving:
            return found


def killed(file: Path, seed: int, chance: Random) -> list[float]:
    """A program that moves the axis, killed behind an order or anywhere; the ways that it was about to go (m)."""
    doom = [str(chance.randrange(3)), "order"] if seed % 2 == 0 else [str(chance.randrange(2, 60)), "request"]
    words = [sys.executable, "-c", PROGRAM, str(file), str(seed), *doom]
    ended = subprocess.run(words, capture_output=True, timeout=120, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    return [float(word) for word in ended.stdout.split()]


@pytest.mark.timeout(0)
def test_the_one_move_that_was_ordered_comes_to_its_end_and_no_other_begins(
    tmp_path: Path, rounds: Callable[[int], int], unhurried: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    control, file, chance, caught = tmp_path / "control", tmp_path / "motorbus.toml", Random(8), 0
    with Simulated("stepper", link=tmp_path / "stage", control=str(control)) as stage:
        axes = {"lift": {"low": "-200 mm"}}
        file.write_text(described({"stage": stage.bus}, "", "", True, axes, {}), encoding="utf-8")
        for seed in range(rounds(100_000) // 2_500):
            before = at_rest(control)
            ways = killed(file, seed, chance)
            caught += place(control)[1]
            after = at_rest(control)
            ends = sum(ways[:-1]), sum(ways)
            assert any(abs(after - before - end) <= 3 * PULSE for end in ends), (seed, after - before, ways)
            assert_connecting_only_asks(file, monkeypatch)
            assert place(control) == (after, False)
            assert main(["recover", stage.bus, "--yes"]) == 0
    assert caught, "no movement was cut"


def assert_connecting_only_asks(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Open the machine and leave it again: all that is sent are questions."""
    sent: list[Data] = []
    write = SerialLink.write

    def noted(link: SerialLink, data: Data) -> None:
        sent.append(data)
        write(link, data)

    with monkeypatch.context() as patched:
        patched.setattr(SerialLink, "write", noted)
        with Robot.load(file):
            pass
    assert sent
    assert [data for data in sent if data[2] not in ASKS] == []
