"""The control table of one servo as the bytes a host sees, derived from the rows of its register map.

Every byte is kept twice: the live one, which is read and obeyed, and for the EEPROM the stored one, which
comes back after a power cycle. The lock stands between the two and not before the live one: a locked write is
obeyed and lost (feetech-cli, measured on STS3215). There is no code for a refused write, so what may not be
written is dropped without a word.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from motorbus.core.entry import Coding, Entry, Storage, Table

SIZE = 256


class Layout:
    """What the rows of a table say about each byte; one for all servos that share the table."""

    def __init__(self, table: Table, defaults: Mapping[str, int]) -> None:
        self.table = table
        self.rows: list[Entry | None] = [None] * SIZE
        for entry in table.values():
            for address in range(entry.address, entry.address + entry.size):
                self.rows[address] = entry
        self.plain = {
            entry.name: entry.address
            for entry in table.values()
            if entry.size == 1 and entry.coding is Coding.UNSIGNED
        }
        self.factory = bytes(_image(table, defaults))

    def keeps(self, address: int) -> bool:
        """Whether this byte survives a power cycle."""
        row = self.rows[address]
        return row is not None and row.storage is not Storage.RAM

    def touched(self, address: int, count: int) -> list[Entry]:
        """The rows of which at least one byte lies in this range, in order."""
        found = dict.fromkeys(row.name for row in self.rows[address : address + count] if row is not None)
        return [self.table[name] for name in found]


class Written(NamedTuple):
    """What a write did: the names of the rows it changed or repeated, and whether the EEPROM was written."""

    names: frozenset[str]
    stored: bool


class Memory:
    """256 bytes, live and stored. `wear` counts how often each EEPROM byte was written."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.live = bytearray(layout.factory)
        self.stored = bytearray(layout.factory)
        self.wear: Counter[int] = Counter()

    def __getitem__(self, name: str) -> int:
        """The raw value of a row."""
        plain = self.layout.plain.get(name)  # most rows are one byte, and each packet asks for ten of them
        if plain is not None:
            return self.live[plain]
        entry = self.layout.table[name]
        return entry.decode(bytes(self.live[entry.address : entry.address + entry.size]))

    def __setitem__(self, name: str, raw: int) -> None:
        """Set the live value as the servo itself does: no lock, no access right; what does not fit is cut."""
        entry = self.layout.table[name]
        self.live[entry.address : entry.address + entry.size] = code(entry, raw)

    def read(self, address: int, count: int) -> bytes:
        """Live bytes; where no register is, and beyond the last address, there are zeros."""
        return bytes(self.live[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, data: bytes, *, locked: bool, strict: bool = False) -> Written:
        """Write what may be written. `strict` drops values outside the range of their row."""
        names = []
        stored = False
        for entry in self.layout.touched(address, len(data)):
            if not entry.writable or entry.storage is Storage.FACTORY:
                continue
            if strict and not self._fits(entry, address, data):
                continue
            names.append(entry.name)
            stored |= self._put(entry, address, data, locked)
        return Written(frozenset(names), stored)

    def store(self, name: str) -> None:
        """Make the live value of a row survive a power cycle."""
        entry = self.layout.table[name]
        for address in range(entry.address, entry.address + entry.size):
            self.stored[address] = self.live[address]
            self.wear[address] += 1

    def power_up(self) -> None:
        """The EEPROM as it was stored, everything else as it is at the beginning."""
        for address in range(SIZE):
            keeps = self.layout.keeps(address)
            self.live[address] = self.stored[address] if keeps else self.layout.factory[address]

    def restore_factory(self, keep: frozenset[str]) -> None:
        """Everything as shipped but the rows named, live and stored."""
        for entry in self.layout.table.values():
            if entry.name in keep or entry.storage is Storage.FACTORY:
                continue
            span = slice(entry.address, entry.address + entry.size)
            self.live[span] = self.stored[span] = self.layout.factory[span]

    def _put(self, entry: Entry, address: int, data: bytes, locked: bool) -> bool:
        stores = entry.storage is Storage.EEPROM and not locked
        for place in range(entry.address, entry.address + entry.size):
            if address <= place < address + len(data):
                self.live[place] = data[place - address]
                if stores:
                    self.stored[place] = data[place - address]
                    self.wear[place] += 1
        return stores

    def _fits(self, entry: Entry, address: int, data: bytes) -> bool:
        after = bytearray(self.live)
        after[address : address + len(data)] = data
        return (
            entry.low <= entry.decode(bytes(after[entry.address : entry.address + entry.size])) <= entry.high
        )


def code(entry: Entry, raw: int) -> bytes:
    """A raw value as the bytes of a row, cut to what its coding can say: a reading has no range but that."""
    bits = entry.sign_bit if entry.coding is Coding.SIGN_MAGNITUDE and entry.sign_bit is not None else None
    if bits is None:
        value = max(0, min(raw, (1 << 8 * entry.size) - 1))
    else:
        value = min(abs(raw), (1 << bits) - 1) | (1 << bits if raw < 0 else 0)
    return value.to_bytes(entry.size, "little" if entry.order == "little" else "big")


def _image(table: Table, defaults: Mapping[str, int]) -> bytearray:
    image = bytearray(SIZE)
    for entry in table.values():
        raw = defaults.get(entry.name, entry.default or 0)
        image[entry.address : entry.address + entry.size] = code(entry, raw)
    return image
