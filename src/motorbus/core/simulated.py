"""Parts of a simulated serial bus: power of a device, and a line that finds requests and sends replies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Generic, TypeVar

from motorbus.core.framing import FrameParser
from motorbus.core.request import Data


class PoweredDevice:
    """A simulated device that can lose its supply. A subclass defines `power_off` and `power_on`."""

    plugged = True

    def power_off(self) -> None:
        """The supply goes."""
        raise NotImplementedError

    def power_on(self) -> None:
        """The supply is back: volatile values are as shipped."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Disconnect bus and supply."""
        self.power_off()
        self.plugged = False

    def plug(self) -> None:
        """Connect it again."""
        if not self.plugged:
            self.plugged = True
            self.power_on()

    def power_cycle(self) -> None:
        """Take the supply away and give it back at once; no effect without a supply."""
        if self.plugged:
            self.power_off()
            self.power_on()


D = TypeVar("D", bound=PoweredDevice)


class SerialLine(Generic[D]):
    """A simulated half-duplex line; see `core.family.Simulator`. A subclass defines `carry_out`.

    `rate` is the bit rate of the devices; until `tune` gives the host the same rate they receive nothing. `now` is the
    latest moment (s).
    """

    def __init__(self, nodes: Mapping[int, D], rate: int, parser: FrameParser) -> None:
        self.nodes = nodes
        self.now = 0.0
        self._rate = rate
        self._host_rate = 0
        self._parser = parser
        self._replies: list[tuple[float, bytes]] = []

    def carry_out(self, frame: bytes, at: float) -> None:
        """Carry out the request in this frame; `send` its replies."""
        raise NotImplementedError

    def send(self, at: float, reply: bytes) -> None:
        """Send a reply at this moment (s)."""
        self._replies.append((at, reply))

    def tune(self, rate: int) -> None:
        """Set the bit rate of the host."""
        self._host_rate = rate

    def receive(self, data: Data, at: float) -> None:
        """Take bytes of the host whose last bit arrives at this moment (s)."""
        self.now = max(self.now, at)
        if not isinstance(data, bytes) or self._host_rate != self._rate:
            return
        for frame, fault in self._parser.feed(data):
            if not fault:
                self.carry_out(frame, at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Return the replies that start up to this moment (s), in order."""
        self.now = max(self.now, to)
        self._replies.sort(key=lambda reply: reply[0])
        sent: list[tuple[float, Data]] = [reply for reply in self._replies if reply[0] <= to]
        del self._replies[: len(sent)]
        return sent

    def due(self) -> float | None:
        """The moment (s) of the next reply, or None."""
        return min((at for at, _ in self._replies), default=None)
