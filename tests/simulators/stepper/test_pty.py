"""The simulated controller on a real pseudo-terminal, worked by a client that imports nothing of motorbus."""

from __future__ import annotations

import ast
import json
import os
import socket
import subprocess
import sys
import tty
from contextlib import closing
from pathlib import Path
from typing import Any, TextIO

import pytest

from motorbus.families.stepper.simulator import simulate
from motorbus.simulation.control import ControlSocket
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Server
from tests.protocol.stepper.vectors import DUMP_A, FOLDER
from tests.simulators.stepper.host import READ, SAVE, SELECT, frame, step
from tests.support.mounts import asked, served

CLIENT = Path(__file__).resolve().parents[2] / "interop" / "stepper_client.py"


def test_the_client_knows_no_motorbus_and_is_short() -> None:
    text = CLIENT.read_text(encoding="utf-8")
    tree = ast.parse(text)
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    origins = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert names | origins <= {"json", "os", "select", "sys", "time", "tty", "__future__"}
    assert len(text.splitlines()) < 80


def test_a_foreign_client_writes_reads_saves_starts_and_hears_the_end() -> None:
    bus = simulate((1,), shipped="empty")
    with closing(PtyMaster()) as master, served(Server(bus, master, rate=9600, pace=True)):
        ended = subprocess.run(
            [
                sys.executable,
                "-I",
                str(CLIENT),
                master.slave_name,
                str(FOLDER / "manual.json"),
                str(FOLDER / "dumps.json"),
            ],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout) == {
        "acknowledged": 15,
        "same": True,
        "saved": "ffaa2e020000",
        "started": "ffaa4e020000eedd",
    }
    assert bus.controller.position == -1600


def ordered(lines: TextIO, order: str) -> dict[str, Any]:
    """Send an order to the control socket; its reply."""
    lines.write(f"{order}\n")
    lines.flush()
    reply: dict[str, Any] = json.loads(lines.readline())
    return reply


@pytest.mark.parametrize(("save_cut", "image"), [("old", DUMP_A[6:]), ("empty", bytes(220))])
def test_the_supply_fails_in_the_middle_of_a_save(save_cut: str, image: bytes, tmp_path: Path) -> None:
    bus = simulate((1,), save_cut=save_cut, save_time=3600.0)
    with (
        closing(PtyMaster()) as master,
        closing(Server(bus, master, rate=9600)) as server,
        closing(ControlSocket(tmp_path / "control", server)),
        served(server),
        closing(socket.socket(socket.AF_UNIX)) as client,
        open(master.slave_name, "r+b", buffering=0) as port,
    ):
        tty.setraw(port.fileno())
        client.settimeout(10.0)
        client.connect(os.fspath(tmp_path / "control"))
        lines = client.makefile("rw")
        for data in (frame(SELECT, 1, 1), step(1, distance=77)[0]):
            assert asked(port.fileno(), data.hex(), 6)[:8] == data.hex(" ").upper()[:8]
        port.write(frame(SAVE, 1))
        stati = (ordered(lines, "status")["nodes"][0] for _ in range(10_000))
        assert any(status["saving"] == 1 for status in stati)  # it has read it, and the save takes an hour
        assert ordered(lines, "power-cycle") == {"ok": True}
        assert asked(port.fileno(), frame(READ, 1).hex(), 226) == (DUMP_A[:6] + image).hex(" ").upper()
