"""Simulators and programs in child processes, ended by their id."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from motorbus import LinkLost, NoReply

ROOT: Final = Path(__file__).parents[2]
LIMIT: Final = 60.0
"""s after which a child counts as hung."""
TRIES: Final = 2_000
"""Calls that `until_back` makes; each one on a lost port looks for it."""


def python(*arguments: str) -> subprocess.Popen[str]:
    """Start `python ARGUMENTS` in a session of its own; it can import `motorbus` and `tests`."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def motorbus(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Run `motorbus ARGUMENTS --json`; return its exit code and its document."""
    child = python("-m", "motorbus.cli", *arguments, "--json")
    output, errors = child.communicate(timeout=LIMIT)
    assert output, errors
    return child.returncode, json.loads(output)


class Simulator:
    """`motorbus simulate` in a child. `address` is the bus for motorbus.open, `port` the path of its pseudo-terminal."""

    def __init__(self, port: Path, family: str, *arguments: str) -> None:
        self.port = port
        self.control = port.with_name(port.name + ".control")
        self._child = python(
            "-m", "motorbus.cli", "simulate", family, "--link", str(port), "--control", str(self.control),
            "--quiet", "--json", *arguments,
        )  # fmt: skip
        assert self._child.stdout is not None
        ready = self._child.stdout.readline()
        assert ready, self._child.communicate()[1]
        self.address: str = json.loads(ready)["bus"]

    def command(self, line: str) -> str:
        """Send one line to the control socket; return the reply."""
        with socket.socket(socket.AF_UNIX) as client:
            client.settimeout(LIMIT)
            client.connect(str(self.control))
            client.sendall(line.encode() + b"\n")
            with client.makefile() as reply:
                return reply.readline().strip()

    def kill(self) -> None:
        """Kill the child; its terminal is gone, and the files that it left are removed."""
        self._child.kill()
        self._child.communicate()
        self.port.unlink(missing_ok=True)
        self.control.unlink(missing_ok=True)

    def end(self) -> None:
        """Ask the child to end."""
        self._child.terminate()
        self._child.communicate(timeout=LIMIT)


@contextmanager
def simulator(port: Path, family: str, *arguments: str) -> Iterator[Simulator]:
    """A simulator that ends with the `with`."""
    running = Simulator(port, family, *arguments)
    try:
        yield running
    finally:
        running.end()


def until_back(read: Callable[[], Any]) -> Any:
    """Call until the port is back and the device answers."""
    for _ in range(TRIES):
        try:
            return read()
        except LinkLost:
            os.sched_yield()
        except NoReply:
            continue
    raise AssertionError("the port did not come back")
