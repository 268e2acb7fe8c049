"""The simulated controller on a real pseudo-terminal, worked by a client that imports nothing of motorbus."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from motorbus.families.stepper.simulator import simulate
from motorbus.link.pty import PtyMaster
from motorbus.simulation.mount import Mount
from tests.families.stepper.vectors import FOLDER
from tests.simulation.served import served

CLIENT = Path(__file__).resolve().parents[3] / "interop" / "stepper_client.py"


def test_the_client_knows_no_motorbus_and_is_short() -> None:
    text = CLIENT.read_text(encoding="utf-8")
    tree = ast.parse(text)
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    origins = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert names | origins <= {"json", "os", "select", "sys", "time", "tty", "__future__"}
    assert len(text.splitlines()) < 80


def test_a_foreign_client_writes_reads_saves_starts_and_hears_the_end() -> None:
    bus = simulate((1,), shipped="empty")
    with closing(PtyMaster()) as master, served(Mount(bus, master, pace=9600)):
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
