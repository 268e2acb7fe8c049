"""A line with random faults."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from random import Random

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Delivery, Side


class NoisyLine:
    """A line with random faults: the same seed and the same traffic give the same bytes at the same moments.

    Probabilities count per packet (what one end sends at once) and lie in 0 … 1:

    `loss` `duplicate`  the whole packet is lost, or arrives twice
    `corrupt`           one byte is changed
    `late`              it arrives late by something within `late_by` (s), and so does all that follows it

    `delay`   every packet arrives up to this many seconds later, in order
    `echo`    the host receives what it sends; the same faults strike the echo
    `toward`  faults strike only what goes to this side; None strikes both
    """

    def __init__(
        self,
        seed: int,
        *,
        delay: float = 0.0,
        loss: float = 0.0,
        duplicate: float = 0.0,
        corrupt: float = 0.0,
        late: float = 0.0,
        late_by: tuple[float, float] = (0.02, 0.5),
        echo: bool = False,
        toward: Side | None = Side.HOST,
    ) -> None:
        self.delay = delay
        self.loss = loss
        self.duplicate = duplicate
        self.corrupt = corrupt
        self.late = late
        self.late_by = late_by
        self.echo = echo
        self.toward = toward
        self._random = Random(seed)
        self._last = {Side.HOST: -inf, Side.DEVICE: -inf}

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        other = Side.DEVICE if sender is Side.HOST else Side.HOST
        deliveries = list(self._toward(other, data, at))
        if self.echo and sender is Side.HOST:
            deliveries += self._toward(Side.HOST, data, at)
        return deliveries

    def _toward(self, to: Side, data: Data, at: float) -> Iterator[Delivery]:
        if self.toward not in (None, to):
            yield Delivery(at, to, data)
        elif not self._strikes(self.loss):
            yield self._delivered(to, data, at)
            if self._strikes(self.duplicate):
                yield self._delivered(to, data, at)

    def _delivered(self, to: Side, data: Data, at: float) -> Delivery:
        span = self.late_by if self._strikes(self.late) else (0.0, self.delay)
        self._last[to] = max(at + self._random.uniform(*span), self._last[to])
        return Delivery(self._last[to], to, self._damaged(data))

    def _strikes(self, probability: float) -> bool:
        return probability > 0 and self._random.random() < probability

    def _damaged(self, data: Data) -> Data:
        held = data.data if isinstance(data, CanFrame) else data
        if not held or not self._strikes(self.corrupt):
            return data
        spot = self._random.randrange(len(held))
        held = held[:spot] + bytes([held[spot] ^ self._random.randrange(1, 256)]) + held[spot + 1 :]
        return data._replace(data=held) if isinstance(data, CanFrame) else held
