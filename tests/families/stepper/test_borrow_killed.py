"""Killed in earnest in the middle of a jog: kill -9 at a request of a borrow, the controller in another process.

The next command is told that project 1 is borrowed and writes nothing, jog and run are refused, and `motorbus recover`
brings it back. A few places here, every one in the long runs; all of them in virtual time by `test_borrow_cuts`.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import motorbus
from motorbus import session
from motorbus.cli import main
from motorbus.cli.simulated import Simulated
from motorbus.core.request import Data
from motorbus.families.stepper import Controller
from motorbus.link.serial import SerialLink

KILLED_AT = """
import os, signal, sys
from motorbus.cli import main
from motorbus.link import usb_adapters
from motorbus.link.serial import SerialLink

usb_adapters.TERMINAL_LATENCY = 1.0  # whoever answers may have to wait for a processor
write, count = SerialLink.write, [0, int(sys.argv[1])]

def doomed(self, data):
    write(self, data)
    count[0] += 1
    if count[0] > count[1]:
        os.kill(os.getpid(), signal.SIGKILL)

SerialLink.write = doomed
code = main(sys.argv[2:])
print(count[0])
sys.exit(code)
"""
JOG = "=60rpm --seconds 0.1 --yes"
USUAL = (0, 2, 5, 8, 9, 13)
"""Requests: the first look, before the first edit, in the midst of them, before the order, after it, giving back."""
READ = 0x3E
"""The third byte of the request that reads a project."""


@pytest.fixture
def served(tmp_path: Path, unhurried: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Simulated]:
    """A simulated controller in a process of its own on a pseudo-terminal."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Simulated("stepper", link=tmp_path / "bus") as simulated:
        yield simulated


def killed(served: Simulated, request: int) -> int | None:
    """A jog in a process of its own, killed when this request, from 0 on, has left; None, or how many there are."""
    words = f"jog {served.bus}#1{JOG}".split()
    ended = subprocess.run(
        [sys.executable, "-c", KILLED_AT, str(request), *words], capture_output=True, timeout=60, check=False
    )
    if ended.returncode == 0:
        return int(ended.stdout.split()[-1])
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    return None


def stored(bus: str) -> list[bytes]:
    """What all four projects read as; nothing but reading is sent for it."""
    with motorbus.open(bus) as opened:
        return [Controller(opened).dump(project) for project in range(1, 5)]


class Watched:
    """What this process sends by serial ports, from their opening on, and what commands say."""

    def __init__(self, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
        self._capfd = capfd
        self.sent: list[bytes] = []
        write = SerialLink.write

        def watched(link: SerialLink, data: Data) -> None:
            assert isinstance(data, bytes)
            self.sent.append(data)
            write(link, data)

        monkeypatch.setattr(SerialLink, "write", watched)

    def run(self, words: str) -> tuple[int, str, set[int]]:
        """A command: its exit code, what it says, and the third byte of each request it has sent."""
        self.sent.clear()
        self._capfd.readouterr()
        code = main(words.split())
        return code, "".join(self._capfd.readouterr()), {one[2] for one in self.sent}


@pytest.fixture
def watched(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Watched:
    return Watched(capfd, monkeypatch)


def told_and_refused(bus: str, watched: Watched) -> bool:
    """Whether anything is unfinished; then the next command says so, and what moves is refused and sends nothing."""
    with motorbus.open(bus) as opened:
        if session.unfinished(opened) is None:
            assert opened.warnings == ()
            return False
    code, told, sent = watched.run(f"ping {bus}#1")
    assert (code, sent) == (0, {READ}), "opening and looking write nothing"
    assert "the borrow of project 1 (for jog), begun" in told
    assert f"`motorbus recover {bus}`" in told
    for words in (f"jog {bus}#1{JOG}", f"stepper run {bus} --project 1 --yes"):
        code, told, sent = watched.run(words)
        assert (code, sent) == (2, {READ}), words
        assert "the borrow of project 1 (for jog)" in told
        assert f"`motorbus recover {bus}`" in told
    return True


@pytest.mark.parametrize("request_", USUAL)
def test_kill_9(request_: int, served: Simulated, watched: Watched) -> None:
    before = stored(served.bus)
    assert killed(served, request_) is None
    borrowed = told_and_refused(served.bus, watched)
    assert borrowed is (request_ > 2)
    code, told, _ = watched.run(f"recover {served.bus} --yes")
    assert code == 0, told
    assert ("given back: the borrow of project 1 (for jog)" in told) is borrowed, told
    assert stored(served.bus) == before
    assert main(f"jog {served.bus}#1{JOG}".split()) == 0
    assert stored(served.bus) == before


@pytest.mark.timeout(1800)
def test_kill_9_at_every_request(served: Simulated, watched: Watched, rounds: Callable[[int], int]) -> None:
    """All of them in the long runs only: each takes a process."""
    before = stored(served.bus)
    total = killed(served, 1_000_000)
    assert total is not None
    assert total >= 19
    every = range(min(total, rounds(1_000_000) // 10_000))
    found = 0
    for request in every:
        assert killed(served, request) is None
        found += told_and_refused(served.bus, watched)
        assert main(["recover", served.bus, "--yes"]) == 0
        assert stored(served.bus) == before, request
    assert found >= len(every) - 6
