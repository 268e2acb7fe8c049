"""Simulated devices on a CAN channel of python-can: `can://virtual/NAME`, `can://socketcan/vcan0` …

A program with a python-can bus, in this process or on this machine, finds them there without a port of ours. The
devices take part through the link by which a host would reach real ones.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.link.base import Link
from motorbus.link.url import open_can

SCHEME: Final = "can://"


def may_have_wire(port: str) -> bool:
    """Whether real devices may be on this CAN channel; opens nothing. Raises RequestError for another port."""
    from motorbus.link.can import read_address

    return not read_address(port).no_wire


class CanChannel:
    """A CAN channel with all its programs and devices; the interface is that of `clients.Client`.

    `rate` is in bit/s from the user (0: not given), `default_rate` that of the devices; `options` are for the adapter.
    `has_wire`: real devices may be on it. Raises RequestError for another port, and what opening a CAN link raises.
    """

    can_unplug = False
    gone = False

    def __init__(self, port: str, rate: int = 0, default_rate: int = 0, **options: object) -> None:
        if not port.startswith(SCHEME):
            raise RequestError(f"{port!r} is no CAN channel", expected="can://INTERFACE/CHANNEL")
        link: Link = open_can(port, rate=rate, default_rate=default_rate, options=options, shared=True)
        self.link = link
        self.name = port
        self.has_wire = not getattr(link, "no_wire", False)
        self.lost = 0

    def fileno(self) -> int | None:
        return self.link.fileno()

    def receive(self, wait: float = 0.0) -> list[Data]:
        """The frames that have arrived; wait so long (s) for the first."""
        return self.link.read(self.link.now() + wait)

    def rate(self) -> int | None:
        return None

    def send(self, data: Data, at: float) -> None:
        if isinstance(data, CanFrame) and data.id & ERROR_FLAG:
            return  # that adapter reports its own errors
        try:
            self.link.write(data)
        except LinkLost:
            raise
        except LinkError:
            self.lost += 1

    def flush(self) -> bool:
        return True

    def close(self) -> None:
        self.link.close()
