"""Simulated KST servos in a process of their own, and how python-can's back ends are told to reach them."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.support.processes import Simulated

RATE = 500_000


class Way(NamedTuple):
    """What python-can's `Bus` takes."""

    interface: str
    channel: str
    kwargs: dict[str, object]


class CanBus:
    """A bus that is served by slcan on a pseudo-terminal."""

    def __init__(self, simulated: Simulated, folder: Path) -> None:
        self.simulated = simulated
        self._folder = folder

    def way(self, rate: int = RATE) -> Way:
        """How python-can reaches it."""
        return Way("slcan", str(self._folder / "can"), {"bitrate": rate, "sleep_after_open": 0})

    def order(self, text: str) -> str:
        """What the control socket answers to this."""
        with socket.socket(socket.AF_UNIX) as control:
            control.settimeout(30)
            control.connect(str(self._folder / "control"))
            control.sendall(text.encode() + b"\n")
            return control.makefile().readline().strip()

    def nodes(self) -> list[dict[str, object]]:
        """How the servos are, as the control socket tells it."""
        nodes: list[dict[str, object]] = json.loads(self.order("status"))["nodes"]
        return nodes


@contextmanager
def can_bus(folder: Path, ids: str = "0x25", **flags: str) -> Iterator[CanBus]:
    """A bus with these servos; its link and its control socket stand in this folder."""
    control, link = folder / "control", folder / "can"
    flags = {"control": str(control), **flags}
    with Simulated("kst", ids=ids, link=link, tcp="", pace=False, **flags) as simulated:
        yield CanBus(simulated, folder)
