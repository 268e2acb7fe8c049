"""Simulated KST servos in a process of their own, reached by slcan on a pseudo-terminal."""

from __future__ import annotations

import json
import socket
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.processes import Simulated

RATE = 500_000
MODULES = sysconfig.get_path("purelib")
"""Where python-can and pyserial are; motorbus is installed by a path file, so it is not in there."""


class CanBus:
    """The bus: `channel` is the port for python-can."""

    def __init__(self, folder: Path) -> None:
        self.channel = str(folder / "can")
        self._folder = folder

    def order(self, text: str) -> str:
        """Send a word to the control socket; returns its reply."""
        with socket.socket(socket.AF_UNIX) as control:
            control.settimeout(30)
            control.connect(str(self._folder / "control"))
            control.sendall(text.encode() + b"\n")
            return control.makefile().readline().strip()

    def nodes(self) -> list[dict[str, object]]:
        """The state of the servos, by the control socket."""
        nodes: list[dict[str, object]] = json.loads(self.order("status"))["nodes"]
        return nodes


@contextmanager
def can_bus(folder: Path, ids: str = "0x25", **flags: str) -> Iterator[CanBus]:
    """A bus with these servos; its link and its control socket stand in this folder."""
    control, link = folder / "control", folder / "can"
    with Simulated("kst", ids=ids, link=link, tcp="", pace=False, control=str(control), **flags):
        yield CanBus(folder)
