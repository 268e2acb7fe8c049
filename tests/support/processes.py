"""Simulators and programs in child processes, ended by their id."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Self

from motorbus import LinkLost, NoReply
from motorbus.errors import MotorbusError

ROOT: Final = Path(__file__).parents[2]
LATENCY: Final = ",latency=0.1"
"""Option of a serial address: a child on a busy machine may hold a reply back for so long (s)."""
LIMIT: Final = 60.0
"""s after which a child counts as hung."""


@contextmanager
def python(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run `python ARGUMENTS` in a child that can import `motorbus` and `tests`; it is killed at the end."""
    with _started(arguments) as child:
        try:
            yield child
        finally:
            child.kill()


def _started(arguments: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def motorbus(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Run `motorbus ARGUMENTS --json`; return its exit code and its document."""
    with python("-m", "motorbus", *arguments, "--json") as child:
        output, errors = child.communicate(timeout=LIMIT)
    assert output, errors
    return child.returncode, json.loads(output)


class Simulator:
    """Devices on a pseudo-terminal, served by a child.

    `address` is for motorbus.open, `port` the path of its pseudo-terminal.
    """

    def __init__(self, port: Path, family: str, *arguments: str) -> None:
        self.port = port
        self.control = port.with_name(port.name + ".control")
        flags = ("--link", str(port), "--control", str(self.control))
        self._child = _started(("-m", "tests.support.serve", family, *flags, *arguments))
        assert self._child.stdout is not None
        ready = self._child.stdout.readline()
        assert ready, self._child.communicate()[1]
        self.address: str = json.loads(ready)["bus"] + (LATENCY if family != "kst" else "")

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


class Simulated:
    """Simulated devices served by a child, for a `with`; flags are those of `serve`. `bus` is the first address.

    Raises MotorbusError with the text of the child if it ends before it is ready.
    """

    def __init__(
        self,
        family: str,
        *,
        ids: str = "1",
        link: Path | None = None,
        tcp: str = "",
        pace: bool = False,
        **flags: str,
    ) -> None:
        words = ["-m", "tests.support.serve", family, "--ids", ids]
        words += ["--link", str(link)] if link else []
        words += ["--tcp", tcp] if tcp else []
        words += ["--pace"] if pace else []
        words += [word for name, value in flags.items() for word in (f"--{name}", value)]
        self._words = words
        self._process: subprocess.Popen[str] | None = None
        self.ready: dict[str, Any] = {}

    @property
    def bus(self) -> str:
        """The first address."""
        return str(self.ready["bus"])

    @property
    def buses(self) -> list[str]:
        """Every address."""
        return [str(bus) for bus in self.ready["buses"]]

    @property
    def process(self) -> subprocess.Popen[str]:
        """The child."""
        assert self._process is not None
        return self._process

    def __enter__(self) -> Self:
        self._process = _started(self._words)
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise MotorbusError(f"the simulated bus did not start: {self._process.communicate()[1].strip()}")
        self.ready = json.loads(line)
        return self

    def end(self) -> int:
        """Ask the child to end; return its exit code."""
        self.process.terminate()
        self.process.communicate(timeout=LIMIT)
        return self.process.returncode

    def __exit__(self, *_: object) -> None:
        self.end()


def until_back(read: Callable[[], Any]) -> Any:
    """Call until the port is back and the device answers; each call on a lost port looks for it."""
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        try:
            return read()
        except (LinkLost, NoReply):
            os.sched_yield()
    raise AssertionError("the port did not come back")
