"""A simulated CAN bus as small as it can be: every frame is answered, by an identifier of its own."""

from __future__ import annotations

from collections.abc import Mapping

from motorbus.core.can_frame import Audience, CanFrame
from motorbus.core.family import SimulatedNode
from motorbus.core.request import Data

ANSWER = 0x80
"""The bit by which an answer's identifier differs."""
THINKS = 0.0002


class Parrots:
    """Answers what it hears at its own rate, `thinks` seconds later. `heard` is what that was, with the moments.

    All is for them but what is in `others`, and for everyone what is in `calls`.
    """

    def __init__(self, rate: int = 500_000, *, thinks: float = THINKS) -> None:
        self.rate = rate
        self.thinks = thinks
        self.tuned: list[int] = []
        self.heard: list[tuple[float, Data]] = []
        self.saying: list[tuple[float, CanFrame]] = []
        self.poked = 0
        self.others: set[int] = set()
        self.calls: set[int] = set()

    def audience(self, data: Data) -> Audience:
        assert isinstance(data, CanFrame)
        if data.id in self.others:
            return Audience.NONE
        return Audience.EVERYONE if data.id in self.calls else Audience.OURS

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        return {}

    def poke(self) -> None:
        self.poked += 1

    def say(self, frame: CanFrame, at: float) -> None:
        """Something nobody has asked for."""
        self.saying.append((at, frame))

    def receive(self, data: Data, at: float) -> None:
        if self.tuned and self.tuned[-1] != self.rate:
            return
        assert isinstance(data, CanFrame)
        self.heard.append((at, data))
        self.saying.append((at + self.thinks, data._replace(id=data.id ^ ANSWER)))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        said: list[tuple[float, Data]] = [(at, frame) for at, frame in self.saying if at <= to]
        self.saying = [(at, frame) for at, frame in self.saying if at > to]
        return said

    def due(self) -> float | None:
        return min((at for at, _ in self.saying), default=None)

    def tune(self, rate: int) -> None:
        self.tuned.append(rate)
