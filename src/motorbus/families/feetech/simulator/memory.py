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

from motorbus.core.register import Register, RegisterMap, Storage

SIZE: Final = 256
ERASED: Final = 0xFF
_KEPT: Final = "max_acceleration"  # lerobot writes this factory row: kept until power-off # assumption


class Cell(NamedTuple):
    """An EEPROM cell that is stored from `begin` to `end` (s), if the supply lasts."""

    begin: float
    end: float
    address: int
    value: int


class Memory:
    """The registers of one servo: `live` are the bytes, `values` the raw values by name, which follow them."""

    def __init__(
        self,
        table: RegisterMap,
        shipped: Mapping[str, int],
        now: Callable[[], float],
        time: float = 0.0,
        torn: str = "erased",
    ) -> None:
        """`shipped` are raw values of rows; `time` is the s of a write to the EEPROM, `torn` as in `Quirks`."""
        self.table = table
        self.shipped = bytearray(SIZE)
        self._rows: list[Register | None] = [None] * SIZE
        for row in table.values():
            self._rows[span(row)] = [row] * row.size
            self.shipped[span(row)] = code(row, shipped.get(row.name, row.default or 0))
        self.live = bytearray(self.shipped)
        self.values: dict[str, int] = {}
        self.decode(table.values())
        self._now = now
        self._time = time
        self._torn = torn
        self._stored = bytearray(self.shipped)
        self._wear: Counter[int] = Counter()
        self._waiting: list[Cell] = []

    def touched(self, address: int, count: int) -> Iterable[Register]:
        """The rows with at least one of these bytes, in order."""
        rows = self._rows[address : address + count]
        return {row.name: row for row in rows if row is not None}.values()

    def decode(self, rows: Iterable[Register]) -> None:
        """Set the values of these rows by the live bytes."""
        for row in rows:
            raw = int.from_bytes(self.live[row.address : row.address + row.size], row.order)
            sign = 1 << (8 * row.size if row.sign_bit is None else row.sign_bit)
            self.values[row.name] = raw if raw < sign else sign - raw

    def __getitem__(self, name: str) -> int:
        return self.values[name]

    def __setitem__(self, name: str, raw: int) -> None:
        """Set a live value as the servo itself does, cut to what its row can express; no lock, no rights."""
        row = self.table[name]
        self.live[row.address : row.address + row.size] = code(row, raw)
        self.decode((row,))

    def read(self, address: int, count: int) -> bytes:
        """Live bytes; zeros where no row is."""
        return bytes(self.live[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, data: bytes, *, locked: bool, strict: bool = False) -> set[str]:
        """Write the bytes that a host can write; returns the names of their rows.

        `strict`: without the rows whose value would be out of range.
        """
        names: set[str] = set()
        cells: list[int] = []
        for row in self.touched(address, len(data)):
            if not row.writable and row.name != _KEPT:
                continue
            begin, end = max(row.address, address), min(row.address + row.size, address + len(data))
            old = self.live[begin:end]
            self.live[begin:end] = data[begin - address : end - address]
            self.decode((row,))
            if strict and not row.low <= self.values[row.name] <= row.high:
                self.live[begin:end] = old
                self.decode((row,))
                continue
            names.add(row.name)
            if row.storage is Storage.EEPROM and not locked:
                cells += range(begin, end)
        if cells:
            self.store(cells, self._time)
        return names

    # -- EEPROM ------------------------------------------------------------------------------------

    def store(self, addresses: Iterable[int], time: float) -> None:
        """Store the live values of these cells after those that wait, in `time` s altogether."""
        # All cells take equally long, and closing the lock cuts none. # assumption
        cells = list(addresses)
        start = begin = max(self._now(), self.busy_until)
        for number, address in enumerate(cells, start=1):
            end = start + number * time / len(cells)
            self._waiting.append(Cell(begin, end, address, self.live[address]))
            begin = end

    @property
    def waiting(self) -> list[Cell]:
        """Cells still to be stored, in order."""
        self._settle()
        return self._waiting

    @property
    def stored(self) -> bytearray:
        """The EEPROM cells."""
        self._settle()
        return self._stored

    @property
    def wear(self) -> Counter[int]:
        """How often each cell was stored."""
        self._settle()
        return self._wear

    def _settle(self) -> None:
        while self._waiting and self._waiting[0].end <= self._now():
            cell = self._waiting.pop(0)
            self._stored[cell.address] = cell.value
            self._wear[cell.address] += 1

    @property
    def busy_until(self) -> float:
        """The moment (s) of the last store; -inf when none waits."""
        return self.waiting[-1].end if self.waiting else -inf

    # -- supply ------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """The supply goes: the cell in work is torn, those behind it are lost."""
        if self.waiting and self._waiting[0].begin < self._now():
            cell = self._waiting[0]
            self._wear[cell.address] += 1
            if self._torn != "old":
                self._stored[cell.address] = ERASED if self._torn == "erased" else cell.value
        self._waiting.clear()

    def restart(self) -> None:
        """Load the live values: RAM as shipped, other rows as stored or waiting."""
        cells = bytearray(self.stored)
        for cell in self._waiting:
            cells[cell.address] = cell.value
        self.live = bytearray(self.shipped)
        for row in self.table.values():
            if row.storage is not Storage.RAM:
                self.live[span(row)] = cells[span(row)]
        self.decode(self.table.values())

    def restore_factory(self, keep: Iterable[str], time: float) -> None:
        """All rows but these as shipped; the EEPROM needs `time` s for it."""
        cells: list[int] = []
        for row in self.table.values():
            if row.name not in keep and row.storage is not Storage.FACTORY:
                self.live[span(row)] = self.shipped[span(row)]
                if row.storage is Storage.EEPROM and row.writable:
                    cells += range(row.address, row.address + row.size)
        self.decode(self.table.values())
        self.store(cells, time)


def span(row: Register) -> slice:
    """The bytes of a row."""
    return slice(row.address, row.address + row.size)


def code(row: Register, raw: int) -> bytes:
    """A raw value as bytes, cut to what the row can express, in range or not."""
    largest = (1 << (row.sign_bit or 8 * row.size)) - 1
    raw = max(-largest if row.sign_bit else 0, min(raw, largest))
    number = raw if raw >= 0 else -raw | 1 << (row.sign_bit or 0)
    return number.to_bytes(row.size, row.order)
