"""What can happen to one CAN frame between a host and its servos: lost, there twice, or late. A link keeps the order.

A byte of it cannot change: what the check of a frame does not let pass is sent again or lost as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from motorbus.core.can_bits import ERROR_BITS, bits
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Delivery, Side

BIT = 1 / 500_000
LATE = (0.001, 0.02, 0.06, 0.3)
"""s: within a reply's time, around its end, behind the exchange, behind what follows it."""


class FrameFault(NamedTuple):
    """This frame, counted from 0, of those that go to this side."""

    to: Side
    number: int
    kind: str
    seconds: float = 0.0

    def __str__(self) -> str:
        return f"frame {self.number} to the {self.to.value}: {self.kind} {self.seconds or ''}"


def every_fault(counts: dict[Side, int]) -> Iterator[FrameFault]:
    """Each fault of each frame, so many to each side."""
    for to, count in counts.items():
        for number in range(count):
            yield from (FrameFault(to, number, kind) for kind in ("lost", "doubled"))
            yield from (FrameFault(to, number, "late", seconds) for seconds in LATE)


class FrameLine:
    """Carries frames, in order but for one; `counts` how many to each side, `fired` its fault once that has happened.

    What is `late` holds up what follows it, as a queue does.
    """

    def __init__(self, fault: FrameFault | None = None) -> None:
        self.fault = fault
        self.fired: list[FrameFault] = []
        self.counts = {Side.HOST: 0, Side.DEVICE: 0}
        self._last = {Side.HOST: 0.0, Side.DEVICE: 0.0}

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, CanFrame)
        to = Side.DEVICE if sender is Side.HOST else Side.HOST
        frames = [data]
        if self.fault is not None and to is self.fault.to:
            frames, at = self._struck(self.fault, data, at)
        self.counts[to] += 1
        deliveries = []
        for number, frame in enumerate(frames):
            self._last[to] = max(at, self._last[to]) + number * (ERROR_BITS + bits(frame)) * BIT
            deliveries.append(Delivery(self._last[to], to, frame))
        return deliveries

    def _struck(self, fault: FrameFault, data: CanFrame, at: float) -> tuple[list[CanFrame], float]:
        if self.counts[fault.to] == fault.number:
            self.fired.append(fault)
            return [data] * {"lost": 0, "late": 1, "doubled": 2}[fault.kind], at + fault.seconds
        return [data], at
