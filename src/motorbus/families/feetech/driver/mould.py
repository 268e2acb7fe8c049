"""A SYNC WRITE of which all is known but the values: what a control loop writes again and again.

Who, where, how a value becomes a raw one, how the packet begins: that is found out once. The mould takes what is plain,
numbers whose goals lie within the limits of their servos; whatever is unusual about a value it leaves to those who say
in words what is wrong with it. Both make the same bytes and the same goals.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from struct import Struct
from typing import Final, NamedTuple, TypeAlias
from zlib import adler32

from motorbus.core.register import Register
from motorbus.core.request import SetpointGroup, SetpointWrite
from motorbus.core.setpoint import Setpoint
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import changed_since
from motorbus.families.feetech.driver.node import CHANGES, Node
from motorbus.families.feetech.driver.orders import goals_of
from motorbus.families.feetech.table import Mode

HEAD: Final = 7
"""Bytes of a SYNC WRITE in front of its first item."""
BYTES: Final = tuple(bytes((value,)) for value in range(256))


class Cell(NamedTuple):
    """How a value of one row of one servo becomes its raw value, and which raw values are plain: their bytes are just
    the number, and what they order lies within the limits. `whole`: without a unit, only whole numbers are values."""

    factor: float
    scale: float
    low: int
    high: int
    whole: bool


class Column:
    """One row of all servos.

    In a loop most rows but the goals, as a speed, are what they were: `last` are such values, with their raw values.
    """

    def __init__(self, cells: Sequence[Cell]) -> None:
        self._cells: Final = cells
        plain = {cell.scale for cell in cells if cell.factor == 1}
        alike = len(plain) == 1 and all(cell.factor == 1 for cell in cells)
        # the scale of all, and from where to where a raw value is plain for all
        self._alike: Final = (
            plain.pop() if alike else None,
            max(cell.low for cell in cells),
            min(cell.high for cell in cells),
        )
        self._whole: Final = cells[0].whole
        self.last: tuple[Sequence[float], Sequence[int]] = (), ()

    def raws(self, values: Sequence[float]) -> list[int] | None:
        """What these floats become, one for each servo; None where one is not plain."""
        scale, low, high = self._alike
        if scale is None or self._whole:
            return self._closely(values)
        raws: list[int] = []
        keep = raws.append
        try:
            for value in values:  # one loop for all: here microseconds count
                raw = (value / scale).__round__()  # as `round`, and sooner
                if not low <= raw <= high:
                    return self._closely(values)
                keep(raw)
        except (ValueError, OverflowError):  # not a finite number
            return None
        return raws

    def kept(self, values: Sequence[float]) -> Sequence[int] | None:
        """As `raws`; what is the same as it was last time is not reckoned anew."""
        last, raws = self.last
        if values == last:
            return raws
        found = self.raws(values)
        if found is not None:
            self.last = values, found
        return found

    def _closely(self, values: Sequence[float]) -> list[int] | None:
        """The same, each by what is plain for its own servo."""
        raws = []
        try:
            for value, (factor, scale, low, high, _) in zip(values, self._cells, strict=True):
                raw = round(value / factor / scale)
                if not low <= raw <= high:
                    return None
                raws.append(raw)
        except (ValueError, OverflowError):  # not a finite number
            return None
        return None if self._whole and list(values) != raws else raws


Under: TypeAlias = Sequence[tuple[Node, Node]]
"""Nodes, each with itself as it was when the mould was begun. Whatever they are told later, by whichever thread, all
of the mould is made of that: else values of one setting could leave under another, and nobody would notice."""


class Mould:
    """The packet for these rows, which adjoin and have the same place for all of these nodes. Made by `mould`."""

    def __init__(self, under: Under, rows: Sequence[Sequence[Register]], cells: Sequence[Cell]) -> None:
        nodes, as_made = [node for node, _ in under], [its for _, its in under]
        first, count = rows[0], len(rows[0])
        size = sum(row.size for row in first)
        item = "B" + "".join("BH"[row.size - 1] for row in first)
        self.ids: Final = tuple(node.node for node in nodes)
        self._made_by: Final = [(node, its.settings) for node, its in under]
        self.seen: object = None  # `CHANGES.now` when they were found to be those
        self._rows: Final = [(node, row) for node, its in zip(as_made, rows, strict=True) for row in its]
        self._columns: Final = [Column(cells[place::count]) for place in range(count)]
        self._each: Final = count + 1  # parts of a packet for each servo
        self._floats: Final = [float] * (count * len(nodes))
        self._items: Final = [part for id in self.ids for part in (id, *[0] * count)]
        self._last: tuple[list[float], list[int]] = [], []
        self._pack: Final = Struct(("<" if first[0].order == "little" else ">") + item * len(nodes)).pack
        self._head: Final = wire.sync_write(first[0].address, [(id, bytes(size)) for id in self.ids])[:HEAD]
        self._sum: Final = sum(self._head[2:])
        self._aim: Final = SetpointGroup(self.ids, self._goals, changed_since(self._made_by))
        self._places: Final = _places(as_made, rows, cells)

    def holds(self) -> bool:
        """Whether the settings of all are those that it was made by."""
        now = CHANGES.now
        if now is self.seen:
            return True
        for node, settings in self._made_by:
            if node.settings is not settings and node.settings != settings:
                return False
        self.seen = now
        return True

    def cast(self, values: Sequence[float]) -> SetpointWrite | None:
        """The packet with these values, those of one servo behind those of the one before; None where one of them is
        not plain, or they are not as many as it takes."""
        if [*map(type, values)] != self._floats:
            return None
        count = self._each - 1
        filled: list[int] | None = self._items
        firsts = values
        if count > 1:
            filled, firsts = self._filled(values, count), values[::count]
        raws = self._columns[0].raws(firsts)
        if filled is None or raws is None:
            return None
        items = filled.copy()
        items[1 :: count + 1] = raws
        body = self._pack(*items)
        return SetpointWrite(self._head + body + BYTES[~adler32(body, self._sum) & 255], self._aim, items)

    def _filled(self, values: Sequence[float], count: int) -> list[int] | None:
        """The parts of a packet with all but the values of the first row; in a loop these are mostly what they were."""
        rest = list(values)
        del rest[::count]
        last, filled = self._last
        if rest == last:
            return filled
        items = self._items.copy()
        for place, column in enumerate(self._columns[1:], 1):
            raws = column.kept(values[place::count])
            if raws is None:
                return None
            items[place + 1 :: count + 1] = raws
        self._last = rest, items
        return items

    def _goals(self, items: Sequence[int]) -> tuple[Setpoint, ...]:
        raws = [raw for number, raw in enumerate(items) if number % self._each]
        if self._places:
            return tuple(
                [
                    Setpoint(id, "position", raw * scale * factor, low, high)
                    for (id, scale, factor, low, high), raw in zip(self._places, raws, strict=True)
                ]
            )
        pairs = zip(self._rows, raws, strict=True)
        return tuple(goal for (node, row), raw in pairs for goal in goals_of(node, row, raw))


def mould(nodes: Sequence[Node], rows: Sequence[Sequence[Register]]) -> Mould | None:
    """The one for these servos, each with its rows in the order of their addresses; None where nothing so simple holds:
    they are not all in position mode, their rows lie elsewhere, or they do not fit into one packet."""
    places = {tuple((row.address, row.size, row.order) for row in its) for its in rows}
    if len(places) != 1 or len({row.order for row in rows[0]}) != 1 or not _adjoin(rows[0]):
        return None
    if len(nodes) > wire.sync_write_capacity(sum(row.size for row in rows[0])):
        return None
    under = [(node, copy(node)) for node in nodes]
    cells = [_cell(node, row) for (_, node), its in zip(under, rows, strict=True) for row in its]
    found = [cell for cell in cells if cell is not None]
    return Mould(under, rows, found) if len(found) == len(cells) else None


def _places(
    nodes: Sequence[Node], rows: Sequence[Sequence[Register]], cells: Sequence[Cell]
) -> list[tuple[int, float, float, float, float]]:
    """What the goals of these are made of, where they are told a place and nothing else: as `goals_of` makes them."""
    if [row.name for row in rows[0]] != ["goal_position"]:
        return []
    its = [(node.node, cell, node.limits) for node, cell in zip(nodes, cells, strict=True)]
    return [(id, cell.scale, cell.factor, *limits) for id, cell, limits in its if limits is not None]


def _adjoin(rows: Sequence[Register]) -> bool:
    ends = [row.address + row.size for row in rows[:-1]]
    return ends == [row.address for row in rows[1:]] and all(row.size in (1, 2) for row in rows)


def _cell(node: Node, row: Register) -> Cell | None:
    settings = node.settings
    if settings is None or node.known_mode is not Mode.POSITION or row.name not in PLAIN:
        return None
    factor = settings.factors.get(row.name, 1.0) if row.unit else 1.0
    low, high = max(row.low, 0), row.high
    if row.name == "goal_position":
        if settings.limits is None:
            return None
        least, most = (round(limit / factor / row.scale) for limit in settings.limits)
        low, high = max(low, least - 1), min(high, most + 1)
    while low <= high and not _within(node, row, low):
        low += 1
    while low <= high and not _within(node, row, high):
        high -= 1
    return Cell(factor, row.scale if row.unit else 1.0, low, high, not row.unit)


PLAIN: Final = ("goal_position", "goal_time", "goal_velocity")
"""What a servo in position mode is told of where to go, and in what time or how fast: the more, the more of it."""


def _within(node: Node, row: Register, raw: int) -> bool:
    for goal in goals_of(node, row, raw):
        if goal.low is None or goal.high is None or not goal.low <= goal.value <= goal.high:
            return False
    return True
