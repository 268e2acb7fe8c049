"""A simulated controller that any program can open: on a terminal or a socket, with its buttons pressed by a script."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.support.processes import Simulated

START = bytes.fromhex("FFAA4E01000000000000F8")
SAVE_AS_4 = bytes.fromhex("FFAA2E04000000000000DB")
STARTED, DONE = bytes.fromhex("FFAA4E010000"), b"\xee\xdd"


def received(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        data += client.recv(64)
    return data


def test_its_inputs_follow_a_file(tmp_path: Path) -> None:
    script = tmp_path / "buttons.txt"
    script.write_text("0 2 on   # from the beginning\n0 5 on\n3600 1 on\n")
    with Simulated("stepper", link=tmp_path / "bus", inputs=str(script)) as simulated:
        with motorbus.open(simulated.bus) as bus:
            one = motorbus.stepper.Controller(bus)
            assert [one.read_input(port) for port in range(1, 6)] == [False, True, False, False, True]
        assert simulated.bus == f"stepper:{tmp_path / 'bus'}"


def test_a_project_runs_to_its_end_over_a_socket() -> None:
    with (
        Simulated("stepper", tcp="0", ramp_tick_ms="0.5") as simulated,
        socket.create_connection(("127.0.0.1", int(simulated.bus.rpartition(":")[2])), timeout=30) as client,
    ):
        client.sendall(START)
        assert received(client, 8) == STARTED + DONE


def test_its_buttons_are_pressed_by_the_control_socket(tmp_path: Path) -> None:
    control = tmp_path / "control"
    with (
        Simulated("stepper", link=tmp_path / "bus", control=str(control)) as simulated,
        motorbus.open(simulated.bus) as bus,
        socket.socket(socket.AF_UNIX) as client,
    ):
        client.settimeout(30)
        client.connect(str(control))
        lines = client.makefile("rw")
        for order in ("set-input 1 4 on", "status"):
            lines.write(f"{order}\n")
            lines.flush()
            answer = lines.readline().strip()
        assert json.loads(answer)["nodes"][0]["inputs"] == [4]
        assert motorbus.stepper.Controller(bus).read_input(4) is True


@pytest.mark.parametrize("quiet", [False, True])
def test_what_no_host_is_told_is_said_on_stderr_with_its_moment(quiet: bool) -> None:
    words = [sys.executable, "-m", "motorbus", "simulate", "stepper", "--tcp", "0", "--json"]
    words += ["--quiet"] if quiet else []
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as served:
        assert served.stdout is not None
        bus = json.loads(served.stdout.readline())["bus"]
        with socket.create_connection(("127.0.0.1", int(bus.rpartition(":")[2])), timeout=30) as client:
            client.sendall(SAVE_AS_4 * 2)
            assert received(client, 12) == bytes.fromhex("FFAA2E040000") * 2
        served.terminate()
        _, said = served.communicate(timeout=30)
    assert served.returncode == 0
    line = r" *\d+\.\d{3} s  #1: project 1 is saved as project 4\n"
    expected = (
        "" if quiet else f"{line}({line}|… and 1 more\n)"
    )  # two in one second are one line and a number
    assert re.fullmatch(expected, said), said


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["stepper", "--inputs", "not-there.txt"], "cannot be read"),
        (["stepper", "--inputs", "BAD"], "inputs, line 2"),
        (["stepper", "--ids", "1-2"], "one controller"),
        (["feetech", "--inputs", "BAD"], "have no inputs"),
    ],
)
def test_what_cannot_be_scripted_is_refused(words: list[str], says: str, tmp_path: Path, run: Run) -> None:
    bad = tmp_path / "bad.txt"
    bad.write_bytes(b"1.0 2 on\n\xff 9 maybe\n")
    ran = run("simulate", *(str(bad) if word == "BAD" else word for word in words))
    assert ran.code == 2
    assert says in ran.err
