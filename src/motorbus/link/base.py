"""The contract of a link, and of the wire between a host and a simulated device.

A link moves bytes or CAN frames and owns the clock. It is first in, first out: data arrives in the order in which
the other end sent it. The bus never sleeps and reads no clock of its own: it calls `now()` and waits in `read()`. So
the same bus runs in virtual time over a memory link.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol, runtime_checkable

from motorbus.core.request import Data


class Link(Protocol):
    """An open byte stream or CAN channel.

    `name`       the port as the user wrote it, for messages
    `rate`       bit/s
    `latency`    seconds for which the adapter may hold data back
    `paced`      data takes its air time, so a reply that comes sooner is an old one
    `virtual`    time passes only inside `read`
    `simulated`  there is no real device behind it
    `warnings`   what the user should know about this port, such as a slow latency timer
    """

    name: str
    rate: int
    latency: float
    paced: bool
    virtual: bool
    simulated: bool
    warnings: tuple[str, ...]

    def now(self) -> float:
        """Seconds on the monotonic clock of this link."""

    def write(self, data: Data) -> None:
        """Send data without blocking. Raises LinkLost, LinkFull when nothing fits, LinkError when a part was sent."""

    def read(self, until: float) -> list[Data]:
        """Return what has arrived; wait for the first of it until this moment. Raises LinkLost.

        A moment in the past does not wait. The list is empty when nothing arrived.
        """

    def tune(self, rate: int) -> None:
        """Set the rate in bit/s. Raises LinkError."""

    def fileno(self) -> int | None:
        """A descriptor that is readable when data has arrived; None where there is none."""

    def close(self) -> None:
        """Release the port. A second call does nothing."""


@runtime_checkable
class Renewable(Link, Protocol):
    """A link that can be reopened after a loss. No bytes and no requests survive the loss."""

    def renew(self, losses: int) -> None:
        """Reopen the port if it is back and a retry is due. Raises LinkLost with the reason otherwise.

        `losses` counts the losses that the caller has seen. If this loss is already repaired, the call does nothing.
        """

    def rest(self, until: float) -> None:
        """Wait until this moment, or until the next retry is due."""


class Side(Enum):
    """One end of a simulated wire."""

    HOST = "host"
    DEVICE = "device"


class Delivery(NamedTuple):
    """Data that arrives at one end of a simulated wire at this moment (s)."""

    at: float
    to: Side
    data: Data


class Line(Protocol):
    """The wire between a host and simulated devices, with or without faults."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        """Return what arrives of data sent at this moment (s). An echo is a delivery to its sender."""


class PerfectLine:
    """A wire without faults and without delay."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return [Delivery(at, Side.DEVICE if sender is Side.HOST else Side.HOST, data)]
