"""The simulated controller on a pseudo-terminal, used by a client that imports nothing of motorbus."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from motorbus.families.stepper.protocol import RATE
from motorbus.families.stepper.simulator import simulate
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Server, ServerThread

TESTS = Path(__file__).resolve().parents[2]
VECTORS = TESTS / "vectors" / "stepper"


def test_foreign_client_writes_reads_saves_starts_and_receives_the_end() -> None:
    bus = simulate((1,), shipped="cleared")
    with closing(PtyMaster()) as master, ServerThread(Server(bus, master, rate=RATE, pace=True)):
        client = [sys.executable, "-I", str(TESTS / "interop" / "stepper_client.py"), master.slave_name]
        files = [str(VECTORS / "manual.json"), str(VECTORS / "dumps.json")]
        ended = subprocess.run([*client, *files], capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout) == {
        "acknowledged": 15,
        "same": True,
        "saved": "ffaa2e020000",
        "started": "ffaa4e020000eedd",
    }
    assert bus.controller.position == -1600
