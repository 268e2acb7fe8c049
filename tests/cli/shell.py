"""Run command lines in this process, on simulated devices, and judge what they print."""

from __future__ import annotations

import json
import re
import shlex
from io import StringIO
from pathlib import Path
from typing import Final, NamedTuple

import pytest

from motorbus.cli import main
from motorbus.core.can_frame import CanFrame
from motorbus.link.memory import MemoryLink

MACHINE: Final = """format = 1
[bus.arm]
address = "feetech:sim,ids=1-2"
[axis.shoulder]
device = "arm#1"
zero = "180 deg"
low = "-90 deg"
high = "90 deg"
max_velocity = "120 deg/s"
[axis.elbow]
device = "arm#2"
zero = "180 deg"
low = "-90 deg"
high = "90 deg"
max_velocity = "120 deg/s"
[pose.ready]
shoulder = "10 deg"
"""
PROGRAM: Final = """format = 1
name = "Feed"
project = 2
[motor]
microsteps = 8
step_angle = "1.8 deg"
turn_distance = 1600
[[step]]
move = "1 turns"
speed = "240 rpm"
start = "200 Hz"
acceleration = "20 Hz"
"""
FILES: Final = {
    "machine.toml": MACHINE,
    "program.toml": PROGRAM,
    "wave.csv": "time (s),shoulder (deg)\n0,0\n2,5\n",
}
PYTHON: Final = re.compile(r"Traceback|NoneType|object at 0x|\berrno\b|Errno|KeyError|invalid literal|__")
FEETECH_READS: Final = {0x01, 0x02, 0x82}  # ping, read, sync read
STEPPER_READS: Final = (b"\x3e", b"\x00\x0b")  # read project, read input


class Ran(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


class Shell:
    """Runs command lines; `frames` are the bytes that they sent to simulated devices."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys
        self.frames: list[bytes] = []

    def __call__(self, line: str) -> Ran:
        self._capsys.readouterr()
        self.frames.clear()
        code = main(shlex.split(line))
        return Ran(code, *self._capsys.readouterr())

    def writes(self) -> list[bytes]:
        """The frames sent that change something."""
        return [frame for frame in self.frames if changes(frame)]


def changes(frame: bytes) -> bool:
    """Whether a FEETECH, stepper or CAN frame is more than a question."""
    if frame[:2] == b"\xff\xff":
        return frame[4] not in FEETECH_READS
    if frame[:2] == b"\xff\xaa":
        return not frame[2:].startswith(STEPPER_READS)
    return frame[5] & 0xE0 != 0x40  # SDO: anything but an upload


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """A shell in a folder with the files of the table, and without a terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr("sys.stdin", StringIO())
    for name in ("MOTORBUS_MACHINE", "MOTORBUS_BUS"):
        monkeypatch.delenv(name, raising=False)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    made = Shell(capsys)
    write = MemoryLink.write

    def record(link: MemoryLink, data: bytes | CanFrame) -> None:
        made.frames.append(data.flat() if isinstance(data, CanFrame) else bytes(data))
        write(link, data)

    monkeypatch.setattr(MemoryLink, "write", record)
    return made


def check_error(ran: Ran) -> None:
    """One error line, in words of this program, each line cut."""
    lines = ran.err.splitlines()
    assert sum(line.startswith("error: ") for line in lines) == 1, ran.err
    assert PYTHON.search(ran.err) is None, ran.err
    assert all(len(line) < 400 and line.isprintable() for line in lines), ran.err


def check_json_error(ran: Ran) -> None:
    """The error is one JSON object on stderr."""
    last = ran.err.strip().splitlines()[-1]
    assert isinstance(json.loads(last), dict)
