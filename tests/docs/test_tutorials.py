"""Each tutorial: its files, commands and programs in order, in an empty folder; their output is the one shown.

Numbers may differ: some simulators run in real time. `motorbus simulate` runs in a process until the end of the page.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from motorbus.cli import main
from motorbus.link import usb_adapters
from tests.docs.pages import BLOCK, TUTORIALS, Command, missing, name_of, shown
from tests.setup.test_shell import JOINTS, Conversation

NAMED = re.compile(r"# (\S+\.(?:py|toml|json))")
PROGRAMS = {"python": [sys.executable], "pytest": [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"]}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, and no setting of the user."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("COLUMNS", "100")
    for name in ("MOTORBUS_MACHINE", "MOTORBUS_BUS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(usb_adapters, "TERMINAL_LATENCY", 0.02)  # the simulators are other processes
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    return work


@contextmanager
def served(command: Command) -> Iterator[str]:
    """A simulator in a process of its own; gives its first line."""
    words = [sys.executable, "-m", "motorbus", *shlex.split(command.line)[1:]]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline()
        finally:
            process.terminate()
            process.communicate(timeout=30)


def set_up(folder: Path, command: Command) -> str:
    """`motorbus setup`, with `hand.py` of the page as the hand that moves the joints."""
    with Conversation(folder, *shlex.split(command.line)[2:]) as talk:
        talk.wait("middle pose", "")
        talk.wait("end to end")
        subprocess.run([*PROGRAMS["python"], "hand.py", control_of(command)], check=True, timeout=60)
        for _ in range(1 + len(JOINTS)):  # the end of the sweep; each joint moves as named
            talk.wait("", "")
        assert talk.child.wait(60) == 0, talk.text
        return talk.text.replace("[Enter] ", "[Enter]\n")  # a terminal shows the Enter of its user


def control_of(command: Command) -> str:
    """The control socket of the arm that this command is about."""
    return "leader.control" if "leader" in command.line else "arm.control"


def follow(command: Command) -> tuple[int, str]:
    """A command that follows the leader, while `hand.py` moves that."""
    with subprocess.Popen([*PROGRAMS["python"], "hand.py", control_of(command)]):
        return run(command)


def run(command: Command) -> tuple[int, str]:
    """Exit code and output of a command that ends by itself."""
    first, *words = shlex.split(command.line)
    if first == "motorbus":
        out = StringIO()
        with redirect_stdout(out), redirect_stderr(out):
            return main(words), out.getvalue()
    done = subprocess.run(
        [*PROGRAMS[first], *words],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=100,
        check=False,
    )
    return done.returncode, done.stdout


def test_there_is_a_tutorial_for_each_user() -> None:
    assert [page.stem for page in TUTORIALS] == ["arm", "can-servos", "stepper", "tests"]


@pytest.mark.parametrize("page", TUTORIALS, ids=name_of)
def test_the_page_does_what_it_says(page: Path, folder: Path) -> None:
    count = 0
    with ExitStack() as stack:
        for kind, text in BLOCK.findall(page.read_text(encoding="utf-8").replace("/tmp/", f"{folder}/")):
            if kind in ("py", "toml", "json"):
                name = NAMED.match(text)
                assert name, text
                (folder / name[1]).write_text(text, encoding="utf-8")
            for command in shown(text) if kind == "console" else ():
                if command.line.startswith("motorbus simulate "):
                    code, out = 0, stack.enter_context(served(command))
                elif re.match("motorbus setup (calibrate )?--", command.line):
                    code, out = 0, set_up(folder, command)
                elif " follow " in command.line:
                    code, out = follow(command)
                else:
                    code, out = run(command)
                assert code == command.code, f"{command.line}: {out}"
                assert command.output, f"{command.line}: the page shows no output"
                assert missing(command.output, out) == [], f"{command.line}: {out}"
                count += 1
    assert count > 5
