"""`motorbus setup` in a terminal: six new servos, plugged in and swept by a script, to a machine that moves."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from math import radians
from pathlib import Path
from typing import Self

import pytest

import motorbus
from motorbus.cli import main
from motorbus.setup.presets import preset
from tests.support.processes import LIMIT, Simulator, simulator

JOINTS = preset("so101").joints


class Conversation:
    """A running `motorbus setup`, whose text is waited for and answered."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.child = subprocess.Popen(
            [sys.executable, "-m", "motorbus", "setup", *words],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.text = ""
        self._seen = 0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.child.kill()
        self._reader.join()
        with self.child:
            pass

    def _read(self) -> None:
        assert self.child.stdout is not None
        while letter := self.child.stdout.read(1):
            self.text += letter

    def wait(self, part: str, answer: str | None = None) -> None:
        end = time.monotonic() + LIMIT
        while (place := self.text.find(part, self._seen)) < 0:
            assert time.monotonic() < end, self.text
            assert self.child.poll() is None, self.text
            time.sleep(0.02)
        self._seen = place + len(part)
        if answer is not None:
            assert self.child.stdin is not None
            self.child.stdin.write(f"{answer}\n")
            self.child.stdin.flush()


def number(arm: Simulator, talk: Conversation) -> None:
    for joint in reversed(JOINTS):
        talk.wait(f"for id {joint.id}")
        arm.command(f"plug {joint.id + 10}")
        talk.wait("", "")
        talk.wait(f"is id {joint.id}")


def sweep(arm: Simulator, talk: Conversation) -> None:
    talk.wait("middle pose", "")
    talk.wait("end to end")
    for way in ("20deg", "-40deg", "20deg"):
        for joint in JOINTS:
            arm.command(f"push {joint.id} {way}")
        time.sleep(1)
    talk.wait("", "")


def verify(arm: Simulator, talk: Conversation) -> None:
    for joint in JOINTS:
        talk.wait(f"{joint.name}: {joint.positive}")
        time.sleep(0.3)  # it reads where the joints are
        arm.command(f"push {joint.id} {'-16deg' if joint.name == 'elbow_flex' else '16deg'}")


def test_six_new_servos_become_a_machine(tmp_path: Path) -> None:
    with simulator(tmp_path / "port", "feetech", "--ids", "11-16") as arm:
        for joint in JOINTS:
            arm.command(f"unplug {joint.id + 10}")
        with Conversation(tmp_path, "--port", str(tmp_path / "port")) as talk:
            number(arm, talk)
            sweep(arm, talk)
            verify(arm, talk)
            assert talk.child.wait(LIMIT) == 0, talk.text
        assert "elbow_flex moves as named, against the count" in talk.text
        with motorbus.Robot.load(tmp_path / "motorbus.toml") as robot:
            assert list(robot.axes) == [joint.name for joint in JOINTS]
            assert robot.config.axes["elbow_flex"].sign == -1
            assert robot.config.axes["shoulder_pan"].high == pytest.approx(radians(18), abs=0.003)
            robot.move({"shoulder_pan": 0.1, "elbow_flex": -0.1})
            assert robot.positions()["elbow_flex"] == pytest.approx(-0.1, abs=0.01)


def test_a_calibration_goes_out_and_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with motorbus.simulate("feetech", ids="1-6") as sim:
        assert main(["setup", "export", "a.json", "--port", sim.url]) == 0
        found = json.loads((tmp_path / "a.json").read_text())
        assert list(found) == [joint.name for joint in JOINTS]
        assert main(["setup", "export", "a.json", "--port", sim.url]) != 0  # the file exists
        found["elbow_flex"] |= {"homing_offset": -300, "range_min": 900, "range_max": 3000, "drive_mode": 1}
        (tmp_path / "a.json").write_text(json.dumps(found))
        assert main(["setup", "import", "a.json", "--port", sim.url]) == 8  # it asks
        assert sim[3].memory["homing_offset"] == 0
        assert main(["setup", "import", "a.json", "--port", sim.url, "--yes"]) == 0
        memory = sim[3].memory
        names = ("homing_offset", "min_position_limit", "max_position_limit")
        assert [memory[name] for name in names] == [-300, 900, 3000]
        assert main(["setup", "export", "b.json", "--port", sim.url]) == 0
        assert json.loads((tmp_path / "b.json").read_text()) == found
        found["elbow_flex"]["homing_offset"] = 3000
        (tmp_path / "a.json").write_text(json.dumps(found))
        assert main(["setup", "import", "a.json", "--port", sim.url, "--yes"]) != 0
        assert [memory[name] for name in names] == [-300, 900, 3000]
