"""What the tests of the quirks share: simulated servos behind the real bus, and wires that do what was reported.

Everything runs in virtual time on a memory link, with the product's own bus, gate and stop in between.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import motorbus
from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.simulation.named import Simulation


class Bench(NamedTuple):
    """An open bus and the simulated servos at its end."""

    simulation: Simulation
    bus: Bus

    def servo(self, id: int = 1) -> Any:
        """The verbs of one servo."""
        return motorbus.feetech.Servo(self.bus, id)

    def simulated(self, id: int = 1) -> Any:
        """One servo as it really is."""
        return self.simulation[id]

    def wait(self, seconds: float) -> None:
        """Let time pass on the bus, whatever arrives meanwhile."""
        link: Any = self.bus.link
        link.advance(seconds)

    @contextmanager
    def traffic(self) -> Iterator[list[bytes]]:
        """Fills with the requests that leave meanwhile."""
        sent: list[bytes] = []
        subscription = self.bus.trace.subscribe(limit=1_000_000)
        try:
            yield sent
        finally:
            self.bus.trace.unsubscribe(subscription)
            sent += [
                one.data for one in subscription if one.direction == "tx" and isinstance(one.data, bytes)
            ]


@contextmanager
def bench(ids: str = "1", **options: Any) -> Iterator[Bench]:
    """Simulated servos with these ids, and an open bus."""
    with motorbus.simulate("feetech", ids=ids, **options) as simulation, motorbus.open(simulation.url) as bus:
        yield Bench(simulation, bus)


class Lossy(PerfectLine):
    """Loses what servos say as long as `loses` is True of it; `lost` is what was lost."""

    def __init__(self, loses: Callable[[bytes], bool]) -> None:
        self.loses = loses
        self.lost: list[bytes] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.DEVICE and isinstance(data, bytes) and self.loses(data):
            self.lost.append(data)
            return []
        return super().carry(sender, data, at)


class Busy(PerfectLine):
    """A servo that does not listen until `until` (s on the link's clock), and then hears all that was said at once."""

    def __init__(self, until: float) -> None:
        self.until = until

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return super().carry(sender, data, max(at, self.until) if sender is Side.HOST else at)


def instruction(request: bytes) -> int:
    """The instruction byte of a request packet."""
    return request[4]


def writes_to(sent: list[bytes], address: int) -> list[bytes]:
    """The WRITE packets among these that begin at this register."""
    return [one for one in sent if instruction(one) == 3 and one[5] == address]
