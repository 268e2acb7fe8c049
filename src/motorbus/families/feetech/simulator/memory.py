"""Registers of one simulated servo: live bytes, which are read and obeyed, and the EEPROM.

A write with the lock closed takes effect and is lost at power-off (feetech-cli, measured on STS3215). A servo
reports no refused write, so what cannot be written is dropped. EEPROM cells are stored one after the other:
what is stored when the supply goes stays, what waits is lost, and the cell in work is torn.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from math import inf
from typing import Final, NamedTuple

from motorbus.core.register import ByteOrder, Register, RegisterMap, Storage

SIZE: Final = 256
ERASED: Final = 0xFF
_KEPT: Final = (
    "max_acceleration"  # lerobot writes it, though it is factory data: kept until power-off # assumption
)


class Cell(NamedTuple):
    """An EEPROM cell that will hold this value from this moment (s) on, if the supply lasts."""

    moment: float
    address: int
    value: int


class Layout:
    """The rows of a map by address, and the values as shipped; servos of one model share it."""

    def __init__(self, table: RegisterMap, defaults: Mapping[str, int]) -> None:
        self.table = table
        self.shipped = bytearray(SIZE)
        self.codes: dict[str, tuple[slice, ByteOrder, int]] = {}
        """Row -> its bytes, their order, and the code of the sign bit."""
        self._touched: dict[tuple[int, int], list[Register]] = {}
        self.rows: list[Register | None] = [None] * SIZE
        for row in table.values():
            self.rows[span(row)] = [row] * row.size
            sign_bit = 8 * row.size if row.sign_bit is None else row.sign_bit
            self.codes[row.name] = span(row), row.order, 1 << sign_bit
            self.shipped[span(row)] = code(row, defaults.get(row.name, row.default or 0))

    def touched(self, address: int, count: int) -> list[Register]:
        """The rows with at least one of these bytes, in order."""
        found = self._touched.get((address, count))
        if found is None:
            found = list({row.name: row for row in self.rows[address : address + count] if row}.values())
            self._touched[address, count] = found
        return found


class Memory:
    """The registers of one servo by name, as raw values; `live` are the bytes."""

    def __init__(
        self, layout: Layout, now: Callable[[], float], time: float = 0.0, torn: str = "erased"
    ) -> None:
        """`time` is the s of a write to the EEPROM, `torn` as in `Quirks`."""
        self.layout = layout
        self.live = bytearray(layout.shipped)
        self._now = now
        self._time = time
        self._torn = torn
        self._cells = bytearray(layout.shipped)
        self._wear: Counter[int] = Counter()
        self._waiting: list[Cell] = []
        self._begun = -inf

    def __getitem__(self, name: str) -> int:
        place, order, sign = self.layout.codes[name]
        raw = int.from_bytes(self.live[place], order)
        return raw if raw < sign else sign - raw

    def decode(self, row: Register) -> int:
        """The live value of a row."""
        return row.decode(bytes(self.live[span(row)]))

    def __setitem__(self, name: str, raw: int) -> None:
        """Set a live value as the servo itself does, cut to what its row can express; no lock, no rights."""
        row = self.layout.table[name]
        self.live[span(row)] = code(row, raw)

    def read(self, address: int, count: int) -> bytes:
        """Live bytes; zeros where no row is."""
        return bytes(self.live[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, data: bytes, *, locked: bool, strict: bool = False) -> set[str]:
        """Write the bytes that a host can write; returns the names of their rows.

        `strict`: without the rows whose value would be out of range.
        """
        names: set[str] = set()
        cells: list[int] = []
        for row in self.layout.touched(address, len(data)):
            if not row.writable and row.name != _KEPT:
                continue
            old = self.live[span(row)]
            places = range(max(row.address, address), min(row.address + row.size, address + len(data)))
            for place in places:
                self.live[place] = data[place - address]
            if strict and not row.low <= self[row.name] <= row.high:
                self.live[span(row)] = old
                continue
            names.add(row.name)
            if row.storage is Storage.EEPROM and not locked:
                cells += places
        self.store(cells, self._time)
        return names

    # -- EEPROM ------------------------------------------------------------------------------------

    def store(self, addresses: Iterable[int], time: float) -> None:
        """Store the live values of these cells after those that wait, in `time` s altogether."""
        # All cells take equally long, and closing the lock cuts none. # assumption
        cells = list(addresses)
        begin = max(self._now(), self.busy_until)
        if cells and not self._waiting:
            self._begun = begin
        for number, address in enumerate(cells, start=1):
            self._waiting.append(Cell(begin + number * time / len(cells), address, self.live[address]))

    def store_row(self, name: str) -> None:
        """Store the live value of a row."""
        row = self.layout.table[name]
        self.store(range(row.address, row.address + row.size), self._time)

    @property
    def stored(self) -> bytearray:
        """The EEPROM cells."""
        self._settle()
        return self._cells

    @property
    def wear(self) -> Counter[int]:
        """How often each cell was stored."""
        self._settle()
        return self._wear

    @property
    def waiting(self) -> list[Cell]:
        """Cells still to be stored, in order."""
        self._settle()
        return self._waiting

    @property
    def busy_until(self) -> float:
        """The moment (s) of the last store; -inf when none waits."""
        return self.waiting[-1].moment if self.waiting else -inf

    def midway(self) -> float:
        """The moment (s) at which the cell in work is half stored; inf without one."""
        return (self._begun + self.waiting[0].moment) / 2 if self.waiting else inf

    def _settle(self) -> None:
        while self._waiting and self._waiting[0].moment <= self._now():
            self._begun, address, value = self._waiting.pop(0)
            self._cells[address] = value
            self._wear[address] += 1

    # -- supply ------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """The supply goes: the cell in work is torn, those behind it are lost."""
        if self.waiting and self._begun < self._now():
            _, address, value = self._waiting[0]
            self._wear[address] += 1
            if self._torn != "old":
                self._cells[address] = ERASED if self._torn == "erased" else value
        self._waiting.clear()

    def restart(self) -> None:
        """Load the live values: RAM as shipped, other rows as stored or waiting."""
        cells = bytearray(self.stored)
        for cell in self._waiting:
            cells[cell.address] = cell.value
        self.live = bytearray(self.layout.shipped)
        for row in self.layout.table.values():
            if row.storage is not Storage.RAM:
                self.live[span(row)] = cells[span(row)]

    def restore_factory(self, keep: Iterable[str], time: float) -> None:
        """All rows but these as shipped; the EEPROM needs `time` s for it."""
        cells: list[int] = []
        for row in self.layout.table.values():
            if row.name not in keep and row.storage is not Storage.FACTORY:
                self.live[span(row)] = self.layout.shipped[span(row)]
                if row.storage is Storage.EEPROM and row.writable:
                    cells += range(row.address, row.address + row.size)
        self.store(cells, time)


def span(row: Register) -> slice:
    """The bytes of a row."""
    return slice(row.address, row.address + row.size)


def code(row: Register, raw: int) -> bytes:
    """A raw value as bytes, cut to what the row can express, in range or not."""
    largest = (1 << (row.sign_bit or 8 * row.size)) - 1
    raw = max(-largest if row.sign_bit else 0, min(raw, largest))
    number = raw if raw >= 0 else -raw | 1 << (row.sign_bit or 0)
    return number.to_bytes(row.size, "little" if row.order == "little" else "big")
