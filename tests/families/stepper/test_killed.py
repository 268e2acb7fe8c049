"""A jog in a process of its own that is killed by kill -9, the controller in another process.

Kills at every frame, in virtual time, are in `test_power_cuts.py`.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorbus
from motorbus.cli import main
from motorbus.families.stepper import Controller
from tests.support.processes import Simulated

KILLED_AT = """
import os, signal, sys
from motorbus.cli import main
from motorbus.link import usb_adapters
from motorbus.link.serial import SerialLink

usb_adapters.TERMINAL_LATENCY = 1.0  # the simulator may have to wait for a processor
write = SerialLink.write

def doomed(self, data):
    write(self, data)
    if data[2:4] == b"\\x03\\x0c":
        os.kill(os.getpid(), signal.SIGKILL)

SerialLink.write = doomed
main(sys.argv[1:])
"""
JOG = " 60rpm --for 100ms --yes"


@pytest.fixture
def served(tmp_path: Path, unhurried: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Simulated]:
    """A simulated controller in a process of its own on a pseudo-terminal."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Simulated("stepper", link=tmp_path / "bus") as simulated:
        yield simulated


def stored(bus: str) -> list[bytes]:
    """What all four projects read as."""
    with motorbus.open(bus) as opened:
        return [Controller(opened).dump(project) for project in range(1, 5)]


def run(words: str, capfd: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """The exit code of a command, and what it prints."""
    capfd.readouterr()
    return main(words.split()), "".join(capfd.readouterr())


def test_jog_that_was_killed_is_reported_refused_and_recovered(
    served: Simulated, capfd: pytest.CaptureFixture[str]
) -> None:
    bus, before = served.bus, stored(served.bus)
    words = [sys.executable, "-c", KILLED_AT, *f"jog {bus}#1{JOG}".split()]
    killed = subprocess.run(words, capture_output=True, timeout=60, check=False, env=dict(os.environ))
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    code, printed = run(f"info {bus}#1", capfd)
    assert code == 0
    assert "temporary use of project 1" in printed
    assert f"`motorbus recover {bus}`" in printed
    code, printed = run(f"jog {bus}#1{JOG}", capfd)
    assert code == 2
    assert "temporary use of project 1" in printed
    assert stored(bus) != before
    code, printed = run(f"recover {bus} --yes", capfd)
    assert code == 0
    assert "taken back" in printed
    assert stored(bus) == before
    assert run(f"jog {bus}#1{JOG}", capfd)[0] == 0
    assert stored(bus) == before
