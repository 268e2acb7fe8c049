"""A wire with faults by chance."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from random import Random

from motorbus.core.operation import CanFrame, Data
from motorbus.link.base import Delivery, Side
from motorbus.simulation.faults.line import Fired


class NoisyLine:
    """A wire with faults by chance: the same seed and the same traffic give the same bytes at the same moments.

    Probabilities count per packet (what one end sends at once) and lie in 0 … 1:

    `loss` `duplicate`    the whole packet is lost, or comes twice
    `corrupt`             one byte is another one
    `lose_byte` `insert_byte` `double_byte`   one byte is missing, too many, or there twice (not in CAN frames)
    `late`                it comes late by something within `late_by` (s), and so does all that follows it, because
                          devices and adapters are first-in first-out; with `overtake` the rest passes it by

    `delay`   every packet comes up to this many seconds later, order kept
    `echo`    the host hears itself; its echo suffers the same faults; may be switched at any time
    `split`   bytes come in random pieces, up to `gap` seconds apart
    `toward`  faults strike only what goes to this side; None strikes both

    `fired` lists every fault in the order they happened, so that a test can assert that its fault did.
    """

    def __init__(
        self,
        seed: int,
        *,
        delay: float = 0.0,
        loss: float = 0.0,
        duplicate: float = 0.0,
        corrupt: float = 0.0,
        lose_byte: float = 0.0,
        insert_byte: float = 0.0,
        double_byte: float = 0.0,
        late: float = 0.0,
        late_by: tuple[float, float] = (0.02, 0.5),
        overtake: bool = False,
        echo: bool = False,
        split: bool = False,
        gap: float = 0.0002,
        toward: Side | None = Side.HOST,
    ) -> None:
        self.delay = delay
        self.loss = loss
        self.duplicate = duplicate
        self.late = late
        self.late_by = late_by
        self.overtake = overtake
        self.echo = echo
        self.split = split
        self.gap = gap
        self.toward = toward
        self.fired: list[Fired] = []
        self._byte_faults = {
            "corrupt": corrupt,
            "lose_byte": lose_byte,
            "insert_byte": insert_byte,
            "double_byte": double_byte,
        }
        self._random = Random(seed)
        self._last = {Side.HOST: -inf, Side.DEVICE: -inf}

    def count(self, fault: str) -> int:
        """How often this fault has happened."""
        return sum(fired.fault == fault for fired in self.fired)

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        other = Side.DEVICE if sender is Side.HOST else Side.HOST
        deliveries = list(self._toward(other, data, at))
        if self.echo and sender is Side.HOST:
            self.fired.append(Fired(at, "echo", Side.HOST, data))
            deliveries += self._toward(Side.HOST, data, at)
        return deliveries

    def _toward(self, to: Side, data: Data, at: float) -> Iterator[Delivery]:
        if self.toward not in (None, to):
            yield Delivery(at, to, data)
        elif not self._strikes("loss", self.loss, to, data, at):
            yield from self._pieces(to, data, at)
            if self._strikes("duplicate", self.duplicate, to, data, at):
                yield from self._pieces(to, data, at)

    def _pieces(self, to: Side, data: Data, at: float) -> Iterator[Delivery]:
        is_late = self._strikes("late", self.late, to, data, at)
        if is_late:
            moment = max(at + self._random.uniform(*self.late_by), self._last[to])
        else:
            moment = max(at + self._random.uniform(0.0, self.delay), self._last[to])
            if moment > at:
                self.fired.append(Fired(at, "delay", to, data))
        for piece in self._cut(to, self._damaged(to, data, at), at):
            yield Delivery(moment, to, piece)
            if not (is_late and self.overtake):
                self._last[to] = moment
            moment += self._random.uniform(0.0, self.gap) if self.split else 0.0

    def _strikes(self, fault: str, probability: float, to: Side, data: Data, at: float) -> bool:
        if not probability or self._random.random() >= probability:
            return False
        self.fired.append(Fired(at, fault, to, data))
        return True

    def _damaged(self, to: Side, data: Data, at: float) -> Data:
        for fault, probability in self._byte_faults.items():
            if isinstance(data, CanFrame):
                if fault == "corrupt" and data.data and self._strikes(fault, probability, to, data, at):
                    data = data._replace(data=self._struck(fault, data.data))
            elif data and self._strikes(fault, probability, to, data, at):
                data = self._struck(fault, data)
        return data

    def _struck(self, fault: str, data: bytes) -> bytes:
        spot = self._random.randrange(len(data))
        if fault == "insert_byte":
            return data[:spot] + self._random.randbytes(1) + data[spot:]
        struck = {
            "corrupt": bytes([data[spot] ^ self._random.randrange(1, 256)]),
            "lose_byte": b"",
            "double_byte": data[spot : spot + 1] * 2,
        }[fault]
        return data[:spot] + struck + data[spot + 1 :]

    def _cut(self, to: Side, data: Data, at: float) -> list[Data]:
        if isinstance(data, CanFrame):
            return [data]
        if not self.split or len(data) < 2:
            return [data] if data else []
        cuts = sorted(self._random.sample(range(1, len(data)), self._random.randrange(len(data))))
        if cuts:
            self.fired.append(Fired(at, "split", to, data))
        return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]
