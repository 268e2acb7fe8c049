"""What bytes on a wire order, and what they tell: read by hand from the manuals' frames, without the drivers' help.

A `Witness` sits on the wire of a simulated bus. It keeps where each device said it is, and notes every place that
a frame of the host orders. Angles are of the device, in rad. Sources: FEETECH serial bus servo protocol manual V1.01;
STS3215 memory table V3.6; KST CAN protocol manual.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, radians
from typing import NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Delivery, PerfectLine, Side

COUNT = 2 * pi / 4096  # an STS3215
TENTH = radians(0.1)  # a KST servo
SPEED = COUNT  # rad/s of one unit: a step each second
PRESENT, GOAL, VELOCITY, TORQUE = 56, 42, 46, 40
WRITE, REG_WRITE, SYNC_WRITE, READ, SYNC_READ, ACTION = 3, 4, 0x83, 2, 0x82, 5
EVERYONE = 0xFE


class Target(NamedTuple):
    """A place that a frame orders a device to go to, and where that device was heard to be last (None: never)."""

    node: int
    to: float
    heard: float | None


class Speed(NamedTuple):
    """A velocity (rad/s, with its sign), or a bound of one, that a frame orders."""

    node: int
    to: float


class Witness(PerfectLine):
    """A wire that only carries, and listens.

    `speeds` and who was `powered`, given torque, are noted as `targets` are. `waiting` has by node what a servo was
    handed over for the next ACTION: the first register and the bytes. It is noted when that comes, a place also before.
    """

    def __init__(self) -> None:
        self.targets: list[Target] = []
        self.speeds: list[Speed] = []
        self.powered: set[int] = set()
        self.waiting: dict[int, tuple[int, bytes]] = {}
        self.heard: dict[int, float] = {}
        self.heard_at: dict[int, float] = {}

    def forget(self) -> None:
        """Begin anew to note what is ordered; where devices are, and what waits, is kept."""
        self.targets, self.speeds, self.powered = [], [], set()

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.targets += (Target(node, to, self.heard.get(node)) for node, to in self.ordered(data))
        else:
            for node, place in self.told(data):
                self.heard[node], self.heard_at[node] = place, at
        return super().carry(sender, data, at)

    def ordered(self, data: Data) -> Iterator[tuple[int, float]]:
        """The places that this frame orders, by node."""
        raise NotImplementedError

    def told(self, data: Data) -> Iterator[tuple[int, float]]:
        """The places that this frame tells, by node."""
        raise NotImplementedError


class FeetechWitness(Witness):
    """On a line of STS servos: FF FF id length instruction … sum."""

    def __init__(self) -> None:
        super().__init__()
        self._asked: dict[int, tuple[int, int]] = {}

    def ordered(self, data: Data) -> Iterator[tuple[int, float]]:
        assert isinstance(data, bytes)
        while data:  # several frames may leave in one write
            yield from self._ordered_by(data[: 4 + data[3]])
            data = data[4 + data[3] :]

    def _ordered_by(self, data: bytes) -> Iterator[tuple[int, float]]:
        assert data[:2] == b"\xff\xff"
        node, instruction, rest = data[2], data[4], data[5:-1]
        if instruction == READ:
            self._asked[node] = rest[0], rest[1]
        elif instruction == SYNC_READ:
            self._asked.update(dict.fromkeys(rest[2:], (rest[0], rest[1])))
        elif instruction == WRITE:
            yield from self._written(node, rest[0], rest[1:])
        elif instruction == REG_WRITE:
            self.waiting[node] = rest[0], rest[1:]
            yield from self.place(node)
        elif instruction == ACTION:
            for one in list(self.waiting) if node == EVERYONE else [node]:
                if one in self.waiting:
                    yield from self._written(one, *self.waiting.pop(one))
        elif instruction == SYNC_WRITE:
            size = rest[1]
            for start in range(2, len(rest), size + 1):
                yield from self._written(rest[start], rest[0], rest[start + 1 : start + 1 + size])

    def _written(self, node: int, address: int, data: bytes) -> Iterator[tuple[int, float]]:
        """What these bytes from this register on order."""
        self.speeds += (Speed(node, _signed(two) * SPEED) for two in _two(VELOCITY, address, data))
        if 0 <= TORQUE - address < len(data) and data[TORQUE - address]:
            self.powered.add(node)
        yield from ((node, _signed(two) * COUNT) for two in _two(GOAL, address, data))

    def place(self, node: int) -> Iterator[tuple[int, float]]:
        """Where it would go at an ACTION, if anywhere."""
        if node in self.waiting:
            yield from ((node, _signed(two) * COUNT) for two in _two(GOAL, *self.waiting[node]))

    def told(self, data: Data) -> Iterator[tuple[int, float]]:
        assert isinstance(data, bytes)
        while data:
            length = data[3]
            node, values = data[2], data[5 : 3 + length]
            address, count = self._asked.get(node, (0, 0))
            at = PRESENT - address
            if count == len(values) and 0 <= at <= count - 2:
                yield node, _signed(values[at : at + 2]) * COUNT
            data = data[4 + length :]


def _two(register: int, address: int, data: bytes) -> Iterator[bytes]:
    """The two bytes of this register, if they are among these."""
    at = register - address
    if at >= 0 and at + 2 <= len(data):
        yield data[at : at + 2]


def _signed(two: bytes) -> int:
    """Little-endian, bit 15 is the sign."""
    word = two[0] | two[1] << 8
    return -(word & 0x7FFF) if word & 0x8000 else word


class KstWitness(Witness):
    """On a CAN bus of KST servos: SDO downloads to 6003 order, uploads of 6002 tell; node 0 is everyone of `nodes`."""

    def __init__(self, *nodes: int) -> None:
        super().__init__()
        self.nodes = nodes

    def ordered(self, data: Data) -> Iterator[tuple[int, float]]:
        assert isinstance(data, CanFrame)
        node, said = data.id - 0x600, data.data
        if 0 <= node < 128 and said[0] & 0xE0 == 0x20 and said[1:3] == b"\x03\x60":
            to = int.from_bytes(said[4:6], "little", signed=True) * TENTH
            yield from ((one, to) for one in ((node,) if node else self.nodes))

    def told(self, data: Data) -> Iterator[tuple[int, float]]:
        assert isinstance(data, CanFrame)
        node, said = data.id - 0x580, data.data
        if 0 < node < 128 and said[0] & 0xE0 == 0x40 and said[1:3] == b"\x02\x60":
            yield node, int.from_bytes(said[4:6], "little", signed=True) * TENTH
