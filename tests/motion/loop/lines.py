"""Lines on which one device is not heard, or is heard wrongly: what a loop makes of that."""

from __future__ import annotations

from collections.abc import Callable

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Delivery, Side
from tests.support.machines import Heard


class Doubtful(Heard):
    """Whatever the devices `mute` say is lost; what `lying` ones tell of their position is changed by so many counts.

    A lie of a servo has a good checksum, as a fault has that an additive sum of eight bits lets through.
    """

    def __init__(self) -> None:
        super().__init__()
        self.mute: set[int] = set()
        self.lying: dict[int, Callable[[int], int]] = {}

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            return super().carry(sender, data, at)
        node = data.id & 0x7F if isinstance(data, CanFrame) else data[2]
        if node in self.mute:
            return []
        told = self.lying.get(node)
        return super().carry(
            sender, data if told is None or isinstance(data, CanFrame) else _lie(data, told), at
        )


def _lie(data: bytes, told: Callable[[int], int]) -> bytes:
    """An answer FF FF id length error position..., with another position."""
    if len(data) < 8:
        return data
    position = told(int.from_bytes(data[5:7], "little")).to_bytes(2, "little")
    body = data[2:5] + position + data[7:-1]
    return data[:2] + body + bytes((~sum(body) & 0xFF,))
