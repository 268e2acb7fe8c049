"""A simulated controller that any program can open: on a terminal or a socket, with its buttons pressed by a script."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.support.processes import Simulated

START = bytes.fromhex("FFAA4E01000000000000F8")
STARTED, DONE = bytes.fromhex("FFAA4E010000"), b"\xee\xdd"


def received(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        data += client.recv(64)
    return data


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


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["stepper", "--ids", "1-2"], "one controller"),
    ],
)
def test_what_cannot_be_scripted_is_refused(words: list[str], says: str, tmp_path: Path, run: Run) -> None:
    bad = tmp_path / "bad.txt"
    bad.write_bytes(b"1.0 2 on\n\xff 9 maybe\n")
    ran = run("simulate", *(str(bad) if word == "BAD" else word for word in words))
    assert ran.code == 2
    assert says in ran.err
