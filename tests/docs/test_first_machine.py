"""The tutorial of the first machine: all of its commands as written, in order, in an empty folder."""

from __future__ import annotations

import shlex
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from motorbus.cli import main
from motorbus.link import usb_adapters
from motorbus.motion.machine import MachineConfig
from tests.docs.pages import FIRST_MACHINE, blocks, commands

LINES = commands(FIRST_MACHINE)
SERVED = [line for line in LINES if line.startswith("motorbus simulate ")]
TYPED = [line for line in LINES if line not in SERVED]
PROGRAMS = blocks(FIRST_MACHINE, "py")


def words(line: str) -> list[str]:
    """The program that a line of the page starts."""
    return [sys.executable, "-m", "motorbus", *shlex.split(line)[1:]]


@contextmanager
def terminal(line: str, folder: Path) -> Iterator[None]:
    """Run a command in a process, from its first line of output on."""
    with subprocess.Popen(
        words(line), cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        try:
            assert "ready" in process.stdout.readline()
            yield
        finally:
            process.terminate()
            process.communicate(timeout=30)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder in which the simulators of the page are running."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.delenv("MOTORBUS_MACHINE", raising=False)
    work = tmp_path / "work"
    work.mkdir()
    first, second = SERVED
    with terminal(first, work), terminal(second, work):
        yield work


def test_from_init_to_the_first_move_in_five_commands() -> None:
    first = next(place for place, line in enumerate(TYPED) if line.startswith("motorbus move "))
    assert TYPED[0].startswith("motorbus init ")
    assert first + 1 == 5


def test_the_page_does_what_it_says(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(usb_adapters, "TERMINAL_LATENCY", 0.02)  # the simulators are other processes
    for line in TYPED:
        code = main(shlex.split(line)[1:])
        out, err = capsys.readouterr()
        assert (code, out != "") == (0, True), f"{line}: {err}"
    made = MachineConfig.load(folder / "motorbus.toml")
    assert list(made.axes) == ["arm_1", "arm_2", "arm_3", "lift_1"]
    assert {"arm_1", "arm_2", "arm_3"} <= set(made.poses["rest"])
    for program in PROGRAMS:
        with warnings.catch_warnings(action="error"):
            exec(compile(program, "<page>", "exec"), {"__name__": "__main__"})
        out, err = capsys.readouterr()
        assert err == ""
        assert "arm_1" in out


def test_there_are_commands_and_a_program_to_judge() -> None:
    assert len(TYPED) > 9
    assert len(SERVED) == 2
    assert len(PROGRAMS) == 1
