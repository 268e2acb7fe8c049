"""The program as the shell runs it: full disks, closed pipes, signals that come twice, and words of any kind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from motorbus.cli.output import LONGEST
from tests.cli.conftest import Run

MOTORBUS = [sys.executable, "-m", "motorbus"]
BUFFERED = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
SCRIPT = "[31m\x07\x9b\x7f\r\n"
"""What a terminal would obey, or take for another line."""
COMMANDS = [
    "ports",
    "--version",
    "scan feetech:sim --ids 1 --json",
]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_full_disk_is_one_line_and_a_documented_code(command: str) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        ran = subprocess.run(
            [*MOTORBUS, *command.split()],
            stdout=full,
            stderr=subprocess.PIPE,
            env=BUFFERED,
            text=True,
            timeout=60,
        )
    assert ran.returncode == 1
    assert "the output cannot be written: No space left on device" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
def test_a_full_disk_under_stderr_leaves_the_code_of_the_error() -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        words = [*MOTORBUS, "read", "feetech:nowhere#1"]
        assert subprocess.run(words, stdout=full, stderr=full, env=BUFFERED, timeout=60).returncode == 3


@pytest.mark.parametrize("command", COMMANDS)
def test_a_closed_pipe_is_silent_and_cancelled(command: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    ran = subprocess.run(
        [*MOTORBUS, *command.split()],
        stdout=writing,
        stderr=subprocess.PIPE,
        env=BUFFERED,
        text=True,
        timeout=60,
    )
    os.close(writing)
    assert (ran.returncode, ran.stderr) == (10, "")


@pytest.mark.parametrize(
    ("first", "second", "gap"), [("SIGINT", "SIGHUP", 0.005), ("SIGTERM", "SIGINT", 0.0)]
)
def test_a_second_signal_adds_nothing(first: str, second: str, gap: float) -> None:
    words = [*MOTORBUS, "scan", "feetech:sim,ids=1-3", "-v"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=BUFFERED
    ) as process:
        assert process.stderr is not None
        assert process.stderr.readline()
        process.send_signal(getattr(signal, first))
        time.sleep(gap)  # what is tested: a shell and its terminal send one each
        process.send_signal(getattr(signal, second))
        _, err = process.communicate(timeout=60)
    assert process.returncode == 10
    assert "Traceback" not in err
    assert err.count("error: cancelled") == 1


@pytest.mark.parametrize(
    "words",
    [
        ["no\x1b%such"],
        ["scan", "--no\x1b%such", "1", "feetech:sim"],
        ["read", "feetech:\x1b%#1"],
        ["read", "\x1b%"],
        ["read", "feetech:sim#1", "no\x1b%"],
        ["write", "feetech:sim#1", "goal_position=\x1b%"],
        ["move", "feetech:sim#\x1b%=1deg"],
        ["decode", "--family", "feetech", "\x1b%"],
        ["--machine", "/no/\x1b%", "move", "arm=1deg"],
        ["estop", "feetech:\x1b%"],
    ],
    ids=lambda words: " ".join(words).replace("\x1b", ""),
)
@pytest.mark.parametrize("as_json", [False, True])
def test_words_of_any_kind_are_shown_without_control_characters_and_cut(
    as_json: bool, words: list[str], run: Run
) -> None:
    for filling in (SCRIPT, "x" * 100_000, "x " * 50_000):
        ran = run(*(word.replace("%", filling) for word in words), *["--json"] * as_json)
        assert ran.code != 0
        lines = ran.err.splitlines()
        assert all(line.isprintable() for line in lines), ran.err
        assert not any(line.startswith("\x1b") for line in lines)
        if as_json:
            assert all(len(str(part)) <= LONGEST * 4 + 1 for part in json.loads(ran.err).values())
        else:
            assert all(len(line) < LONGEST * 4 + 20 for line in lines)
        if filling is SCRIPT:
            assert "\\x1b" in ran.err
