"""A simulated bus in a process of its own: started, waited for, and ended; what `demo` and the tests stand on."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING, Any, Self

from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from pathlib import Path

PATIENCE = 10.0  # s that it may take to end when asked


class Simulated:
    """`motorbus simulate` as a child; use it in a `with`. `bus` is its address once it is ready.

    `more` are further flags by name: `control`, `socketcand`, or a switch of the family.

    Raises MotorbusError with what it said when it ends before it is ready.
    """

    def __init__(
        self,
        family: str,
        *,
        ids: str = "1",
        link: Path | None = None,
        tcp: str = "",
        pace: bool = False,
        **more: str,
    ) -> None:
        words = [
            family,
            "--ids",
            ids,
            *(["--link", str(link)] if link else []),
            *(["--tcp", tcp] if tcp else []),
        ]
        words += [
            "--quiet",
            *(["--pace"] if pace else []),
        ]  # nobody reads its stderr, and a full pipe would stop it
        words += [word for name, value in more.items() for word in (f"--{name}", value)]
        self._command = [sys.executable, "-m", "motorbus", "simulate", *words, "--json"]
        self._process: subprocess.Popen[str] | None = None
        self.ready: dict[str, Any] = {}

    @property
    def bus(self) -> str:
        """Its address."""
        return str(self.ready["bus"])

    @property
    def buses(self) -> list[str]:
        """Every address by which it can be reached; the first is `bus`."""
        return [str(bus) for bus in self.ready["buses"]]

    @property
    def process(self) -> subprocess.Popen[str]:
        """The child."""
        assert self._process is not None
        return self._process

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()  # it prints when it is ready, or closes when it ends
        if not line:
            _, said = self._process.communicate()
            raise MotorbusError(f"the simulated bus did not start: {said.strip()}")
        self.ready = json.loads(line)
        return self

    def end(self) -> int:
        """Ask it to end; its exit code."""
        self.process.terminate()
        try:
            self.process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()
        return self.process.returncode

    def __exit__(self, *exc: object) -> None:
        self.end()
