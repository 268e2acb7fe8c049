"""What the bytes of a status packet come to, when all is known that it takes: the quick way of a reading.

A reading that is asked for again and again is always made in the same way: the same place in the packet, the same
scale, the same settings of the servo. So that is found out once. Whatever is not as it was then, or is no plain sound
packet without an alarm, is left to those who look at everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Final, Literal, NamedTuple
from zlib import adler32

from motorbus.core.register import Coding, Register
from motorbus.core.request import ExactDecoder
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.node import CHANGES, PRESENT_POSITION, Node, Settings

LONG: Final = 200
"""Bytes of data up to which `adler32` tells the sum: more of them may come to more than its modulus."""
SOUND: Final = 254
"""The last byte of `adler32` of a sound packet: its low half is 1 and the sum of all bytes, of so few."""


def head(id: int, count: int) -> bytes:
    """How a status packet of this servo with so many bytes of data and no alarm begins."""
    return wire.HEADER + bytes((id, count + 2, 0))


class Measure(NamedTuple):
    """How the raw value of one row of one servo becomes a value in its unit, under these settings.

    A code below `plain` is its own raw value. What `node.value` says is this product, of these numbers in this order.
    """

    node: Node
    row: Register
    settings: Settings
    plain: int
    scale: float
    factor: float
    order: Literal["little", "big"]


def measure(node: Node, row: Register) -> Measure | None:
    """The one for a servo as it is now; None where nothing so simple holds."""
    settings = node.settings
    if settings is None or not _is_simple(row, settings):
        return None
    factor = settings.factors.get(row.name, 1.0)
    order: Literal["little", "big"] = "little" if row.order == "little" else "big"
    return Measure(node, row, settings, _plain(row), row.scale, factor, order)


def _is_simple(row: Register, settings: Settings) -> bool:
    return bool(row.unit) and not (settings.shift and row.name == PRESENT_POSITION)


def _plain(row: Register) -> int:
    """A code below this is its own raw value."""
    if row.sign_bit is not None:
        return 1 << row.sign_bit
    return 1 << 8 * row.size - (row.coding is Coding.TWOS_COMPLEMENT)


def quantity(node: Node, row: Register, count: int) -> ExactDecoder[float] | None:
    """What a status packet says that brings this row, and perhaps a byte more: its value in the row's unit."""
    settings = node.settings
    if settings is None or row.size > 2 or not _is_simple(row, settings):
        return None
    plain, scale, factor = _plain(row), row.scale, settings.factors.get(row.name, 1.0)
    begin, size, end, decode = head(node.node, count), wire.OVERHEAD + count, 5 + row.size, row.decode
    wide = row.size == 2
    low, high = (5, 6) if row.order == "little" else (6, 5)

    seen: object = None  # `CHANGES.now` when it was found to have those settings

    def whole(data: bytes, at: float) -> float | None:
        nonlocal seen
        if len(data) != size or data[:5] != begin or adler32(data) & 255 != SOUND:
            return None
        if (now := CHANGES.now) is not seen:
            if node.settings is not settings:
                return None
            seen = now
        raw = data[low] | data[high] << 8 if wide else data[5]
        if raw >= plain:
            raw = decode(data[5:end])
        node.at = at
        node.alarm = ()
        return raw * scale * factor

    return whole


class Packets:
    """The status packets of several servos, one behind the other, each with so many bytes of data.

    `parts` are their places. `unpack` gives one raw value of each, that of its first two bytes.

    All of them are looked at as one great number: a mask shows at once whether each begins as it should. The sums are
    made in the same way. What is summed up of a packet, byte by byte, has room where the packet was, and never so much
    that it would reach the next one.
    """

    def __init__(self, ids: Sequence[int], count: int, order: Literal["little", "big"] = "little") -> None:
        step = wire.OVERHEAD + count
        self.size: Final = step * len(ids)
        self.parts: Final = [slice(start, start + step) for start in range(0, self.size, step)]
        self.unpack: Final = Struct(
            ("<" if order == "little" else ">") + f"5xH{count - 1}x" * len(ids)
        ).unpack
        blank, ends = bytes(count + 1), bytes(step - 1)
        self._begins: Final = int.from_bytes(b"".join(head(id, count) + blank for id in ids), "little")
        self._mask: Final = int.from_bytes((b"\xff" * 5 + blank) * len(ids), "little")
        self._low: Final = int.from_bytes((b"\xff" + ends) * len(ids), "little")
        rest = [bytes((255 - (id + count + 2) & 255,)) + ends for id in ids]
        self._rest: Final = int.from_bytes(b"".join(rest), "little")
        self._singly: Final = len(ids) <= count <= LONG  # fewer packets than bytes in each
        self._shifts: Final = range(8 * 5, 8 * step, 8)

    def are_sound(self, data: bytes) -> bool:
        """Whether these are packets of all of them, with no alarm, and every sum is right."""
        number = int.from_bytes(data, "little")
        if len(data) != self.size or number & self._mask != self._begins:
            return False
        if self._singly:
            return {adler32(data[part]) & 255 for part in self.parts} == {SOUND}
        low, total = self._low, 0
        for shift in self._shifts:
            total += number >> shift & low
        return total & low == self._rest


def blocks(nodes: Sequence[Node], count: int, size: int) -> ExactDecoder[dict[int, bytes]]:
    """The first `count` bytes of data of each, by id, where each packet brings `size`."""
    packets = Packets([node.node for node in nodes], size)
    parts, end = list(zip(nodes, packets.parts, strict=True)), 5 + count

    def whole(data: bytes, at: float) -> dict[int, bytes] | None:
        if not packets.are_sound(data):
            return None
        found = {}
        for node, part in parts:
            found[node.node] = data[part][5:end]
            node.at = at
            node.alarm = ()
        return found

    return whole
