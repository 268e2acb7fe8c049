"""Registers of one simulated servo: live bytes, which are read and obeyed, and the EEPROM.

A write with the lock closed is obeyed and lost at power-off (feetech-cli, measured on STS3215). A servo reports no
refused write, so what cannot be written is dropped. EEPROM cells are stored one after the other: what is stored when
the supply goes stays, what waits is lost, and the cell in work is torn. 20 ms for a write is measured (public recovery
tool for STS3215); that its cells share them equally is not # assumption
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from math import inf
from typing import Final, NamedTuple

from motorbus.core.register import Coding, Register, RegisterMap, Storage

SIZE: Final = 256
ERASED: Final = 0xFF
_EMPTY: Final = SIZE  # one more byte, always 0: the high byte of a row of one byte
_KEPT: Final = (
    "max_acceleration",
)  # lerobot writes this row of the maker; kept until power-off # assumption


class Cell(NamedTuple):
    """An EEPROM cell that will hold this value from this moment (s) on, if the supply lasts."""

    moment: float
    address: int
    value: int


class Place(NamedTuple):
    """The bytes of a row: places of the low and the high one, mask of the magnitude, sign bit."""

    low: int
    high: int
    magnitude: int
    sign: int


class Layout:
    """The rows of a map by address, and the values as shipped; servos of one model share it."""

    def __init__(self, table: RegisterMap, defaults: Mapping[str, int]) -> None:
        self.table = table
        self.rows: list[Register | None] = [None] * SIZE
        self.places = {row.name: _place(row) for row in table.values()}
        self.shipped = bytearray(SIZE + 1)
        self.keeps = [False] * SIZE
        for row in table.values():
            span = slice(row.address, row.address + row.size)
            self.rows[span] = [row] * row.size
            self.keeps[span] = [row.storage is not Storage.RAM] * row.size
            put(self.shipped, self.places[row.name], defaults.get(row.name, row.default or 0))

    def touched(self, address: int, count: int) -> list[Register]:
        """The rows with at least one of these bytes, in order."""
        return list({row.name: row for row in self.rows[address : address + count] if row}.values())


class Memory:
    """The registers of one servo by name, as raw values.

    `stored`  the EEPROM cells; `wear` counts the stores of each
    `waiting` cells still to be stored, in order; `time` is the s of a write; `torn` is in `Quirks`
    """

    def __init__(
        self, layout: Layout, now: Callable[[], float], time: float = 0.0, torn: str = "erased"
    ) -> None:
        self.layout = layout
        self.live = bytearray(layout.shipped)
        self._wear: Counter[int] = Counter()
        self.time = time
        self.torn = torn
        self._now = now
        self._cells = bytearray(layout.shipped)
        self._waiting: list[Cell] = []
        self._begun = -inf

    def __getitem__(self, name: str) -> int:
        low, high, magnitude, sign = self.layout.places[name]
        code = self.live[low] | self.live[high] << 8
        return -(code & magnitude) if code & sign else code & magnitude

    def __setitem__(self, name: str, raw: int) -> None:
        """Set a live value as the servo itself does, cut to what its row can express; no lock, no rights."""
        put(self.live, self.layout.places[name], raw)

    def read(self, address: int, count: int) -> bytes:
        """Live bytes; zeros where no row is."""
        return bytes(self.live[address : min(address + count, SIZE)]).ljust(count, b"\0")

    def write(self, address: int, data: bytes, *, locked: bool, strict: bool = False) -> set[str]:
        """Write the bytes that a host can write; returns the names of their rows.

        `strict`: without the rows whose value would be out of range.
        """
        names: set[str] = set()
        cells: list[int] = []
        for row in self.layout.touched(address, len(data)):
            if not row.writable and row.name not in _KEPT:
                continue
            old = self.live[row.address : row.address + row.size]
            places = range(max(row.address, address), min(row.address + row.size, address + len(data)))
            for place in places:
                self.live[place] = data[place - address]
            if strict and not row.low <= self[row.name] <= row.high:
                self.live[row.address : row.address + row.size] = old
                continue
            names.add(row.name)
            if row.storage is Storage.EEPROM and not locked:
                cells += places
        self.store(cells)
        return names

    # -- EEPROM --------------------------------------------------------------------------------------------------

    def store(self, addresses: Iterable[int], time: float | None = None) -> None:
        """Store the live values of these cells after those that wait, in `time` s altogether."""
        cells = list(addresses)
        begin = max(self._now(), self.busy_until)
        if cells and not self.waiting:
            self._begun = begin
        step = (self.time if time is None else time) / max(1, len(cells))
        self._waiting += [
            Cell(begin + number * step, address, self.live[address])
            for number, address in enumerate(cells, start=1)
        ]

    @property
    def waiting(self) -> list[Cell]:
        self._settle()
        return list(self._waiting)

    @property
    def wear(self) -> Counter[int]:
        self._settle()
        return self._wear

    @property
    def stored(self) -> bytearray:
        self._settle()
        return self._cells

    @property
    def busy_until(self) -> float:
        """The moment (s) of the last store; -inf when none waits."""
        waiting = self.waiting if self._waiting else ()
        return waiting[-1].moment if waiting else -inf

    def midway(self) -> float:
        """The moment (s) at which the cell in work is half stored; inf without one."""
        waiting = self.waiting
        return (self._begun + waiting[0].moment) / 2 if waiting else inf

    def _settle(self) -> None:
        while self._waiting and self._waiting[0].moment <= self._now():
            self._begun, address, value = self._waiting.pop(0)
            self._cells[address] = value
            self._wear[address] += 1

    # -- supply --------------------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """The supply goes: the cell in work is torn, those behind it are lost."""
        waiting = self.waiting
        self._waiting.clear()
        if waiting and self._begun < self._now():
            _, address, value = waiting[0]
            self._wear[address] += 1
            if self.torn != "old":
                self._cells[address] = ERASED if self.torn == "erased" else value

    def restart(self) -> None:
        """Load the live values: EEPROM rows as stored or waiting, others as shipped."""
        cells = bytearray(self.stored)
        for cell in self._waiting:
            cells[cell.address] = cell.value
        self.live = bytearray(self.layout.shipped)
        for address, keeps in enumerate(self.layout.keeps):
            if keeps:
                self.live[address] = cells[address]

    def restore_factory(self, keep: Iterable[str], time: float) -> None:
        """All rows but these as shipped; the EEPROM needs `time` s for it."""
        cells: list[int] = []
        for row in self.layout.table.values():
            span = range(row.address, row.address + row.size)
            if row.name not in keep and row.storage is not Storage.FACTORY:
                self.live[span.start : span.stop] = self.layout.shipped[span.start : span.stop]
                cells += span if row.storage is Storage.EEPROM and row.writable else ()
        self.store(cells, time)


def put(image: bytearray, place: Place, raw: int) -> None:
    """Put a raw value into an image; a value that its row cannot express is cut."""
    if raw < 0 and not place.sign:
        raw = 0
    code = min(abs(raw), place.magnitude) | (place.sign if raw < 0 else 0)
    image[place.low] = code & 0xFF
    if place.high != _EMPTY:
        image[place.high] = code >> 8


def _place(row: Register) -> Place:
    low, high = row.address, row.address + 1 if row.size == 2 else _EMPTY
    if row.order != "little" and row.size == 2:
        low, high = high, low
    if row.coding is Coding.SIGN_MAGNITUDE and row.sign_bit is not None:
        return Place(low, high, (1 << row.sign_bit) - 1, 1 << row.sign_bit)
    return Place(low, high, 0xFFFF if row.size == 2 else 0xFF, 0)
