"""What every link offers: move bytes (or CAN frames), and own the clock.

The bus never looks at a clock of its own and never sleeps: it asks `link.now()` and waits by
`link.read(until)`. So over a memory link the same code runs in virtual time, without threads or sleeps.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol, runtime_checkable

from motorbus.core.operation import Data


class Link(Protocol):
    """An open byte stream, or an open CAN channel.

    `name`       what the user called it, for messages
    `latency`    seconds the adapter may hold a byte back before handing it over
    `paced`      bytes need their air time on this link, so a reply that comes sooner is a stale one
    `virtual`    time passes only inside `read`
    `simulated`  there is no real device behind it
    `warnings`   what the user ought to know about this port (a slow latency timer …)
    """

    name: str
    rate: int
    latency: float
    paced: bool
    virtual: bool
    simulated: bool
    warnings: tuple[str, ...]

    def now(self) -> float:
        """Seconds on a monotonic clock that this link owns."""

    def write(self, data: Data) -> None:
        """Hand over one request without blocking. Raises LinkLost when the port is gone, LinkError when full."""

    def read(self, until: float) -> list[Data]:
        """Whatever has arrived; waits for the first of it, at most up to this moment. [] when nothing came.

        `until` in the past asks without waiting. Raises LinkLost when the port is gone.
        """

    def tune(self, rate: int, listen_only: bool = False) -> None:
        """Change the rate in bit/s, and send nothing from now on if `listen_only`; a serial line is silent anyway.

        Raises LinkError when the adapter cannot do the one or the other.
        """

    def fileno(self) -> int | None:
        """A descriptor that turns readable when something has arrived, or None when there is none."""

    def close(self) -> None:
        """Give the port back. Calling it again does nothing."""


@runtime_checkable
class Renewable(Link, Protocol):
    """A link that can be opened anew when it was lost. Nothing of before is kept: neither bytes nor requests."""

    def renew(self, losses: int) -> None:
        """Open it anew if it is there again, and time to look. Raises LinkLost, saying why it is still gone.

        `losses` is how often the caller has seen it lost: a loss that another thread has mended by now needs nothing.
        """

    def rest(self, until: float) -> None:
        """Let time pass while it is gone: until this moment, or until it is time to look for it again."""


class Side(Enum):
    """Which end of a simulated wire."""

    HOST = "host"
    DEVICE = "device"


class Delivery(NamedTuple):
    """Data that reaches one end of a simulated wire at a moment (s)."""

    at: float
    to: Side
    data: Data


class Line(Protocol):
    """What lies between a host and a simulated device: nothing, or every fault a wire can have.

    It stands between simulator and mount whatever the mount is (memory, pseudo-terminal, TCP).
    """

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        """What becomes of data that one end sent at this moment; an echo is a delivery back to the sender."""


class PerfectLine:
    """A wire that does nothing but carry."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return [Delivery(at, Side.DEVICE if sender is Side.HOST else Side.HOST, data)]
