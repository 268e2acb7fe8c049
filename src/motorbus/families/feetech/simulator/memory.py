"""The control table of one servo as the bytes a host sees, derived from the rows of its register map.

Every byte is kept twice: the live one, which is read and obeyed, and for the EEPROM the stored one, which
comes back after a power cycle. The lock stands between the two and not before the live one: a locked write is
obeyed and lost (feetech-cli, measured on STS3215). There is no code for a refused write, so what may not be
written is dropped without a word. What is stored is stored cell by cell and takes its time: `flash.py`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

from motorbus.core.register import Coding, Register, RegisterMap, Storage
from motorbus.families.feetech.simulator.flash import Commit, Flash
from motorbus.families.feetech.table import BAUD_CODES

SIZE = 256
Tell: TypeAlias = Callable[[Any, float], int]
"""Works out what a row says of a servo at a moment."""
_IDS = 254
"""0 to 253; 254 means all and 255 is the head of a packet."""
# assumption: kept until power-off. lerobot (configure_motors) writes it to every servo and never reads it back.
_KEPT_FACTORY_ROWS = frozenset({"max_acceleration"})


class Written(NamedTuple):
    """What a write did: the names of the rows it changed or repeated, and whether it goes to the EEPROM."""

    names: frozenset[str]
    stored: bool


class Span(NamedTuple):
    """What a write of some bytes in a row can do, whatever they are.

    `pieces`  from which address on, and which of the bytes: of those from `begin` to before `end`
    `cells`   the addresses of those that belong to the EEPROM, in order
    `lives`   what is told of it when nothing of it is stored
    `keeps`   what is told of it when its cells are stored
    """

    pieces: tuple[tuple[int, int, int], ...]
    cells: tuple[int, ...]
    lives: Written
    keeps: Written


class Word(NamedTuple):
    """Where the low and the high byte of a row of two bytes are, and which bits are its magnitude and its sign."""

    low: int
    high: int
    magnitude: int
    sign: int


class Layout:
    """What the rows of a table say about each byte; one for all servos that share the table."""

    def __init__(self, table: RegisterMap, defaults: Mapping[str, int]) -> None:
        self.table = table
        self._touched: dict[tuple[int, int], tuple[Register, ...]] = {}
        self._spans: dict[tuple[int, int], Span] = {}
        self.told: dict[
            tuple[int, int], tuple[tuple[str, Tell], ...]
        ] = {}  # `feedback` keeps its answers here
        self.asked: dict[object, Any] = {}  # and `settings` what the same registers come to
        self.rows: list[Register | None] = [None] * SIZE
        for entry in table.values():
            for address in range(entry.address, entry.address + entry.size):
                self.rows[address] = entry
        self.plain = {
            entry.name: entry.address
            for entry in table.values()
            if entry.size == 1 and entry.coding is Coding.UNSIGNED
        }
        self.id = table["id"].address
        self.words = {entry.name: _word(entry) for entry in table.values() if _is_word(entry)}
        self.scales = {entry.name: entry.scale for entry in table.values()}
        self.factory = bytes(_image(table, defaults))
        self._lasting = [address for address in range(SIZE) if self.keeps(address)]

    def keeps(self, address: int) -> bool:
        """Whether this byte survives a power cycle."""
        row = self.rows[address]
        return row is not None and row.storage is not Storage.RAM

    def touched(self, address: int, count: int) -> tuple[Register, ...]:
        """The rows of which at least one byte lies in this range, in order."""
        known = self._touched.get((address, count))  # hosts ask for the same ranges again and again
        if known is None:
            found = dict.fromkeys(row.name for row in self.rows[address : address + count] if row is not None)
            known = self._touched[address, count] = tuple(self.table[name] for name in found)
        return known

    def span(self, address: int, count: int) -> Span:
        """What a write of so many bytes to this address can do."""
        known = self._spans.get((address, count))  # hosts write to the same ranges again and again
        if known is None:
            known = self._spans[address, count] = _span(self.touched(address, count), address, count)
        return known

    def begun(self, stored: bytearray) -> bytearray:
        """The live bytes when the supply comes: what lasts as it is stored, the rest as at first."""
        live = bytearray(self.factory)
        for address in self._lasting:
            live[address] = stored[address]
        return live


class Memory:
    """256 bytes, live and stored; there are as many of these as servos, so each is kept small.

    `flash`        the cells of the EEPROM; without one of them storing takes no time
    `settled`      nothing but feedback has changed since whoever works with the registers has set this
    """

    # With "__dict__", which costs nothing until then, a test may put a method of its own in.
    __slots__ = ("__dict__", "flash", "layout", "live", "settled")

    def __init__(self, layout: Layout, flash: Flash | None = None) -> None:
        self.layout = layout
        self.live = bytearray(layout.factory)
        self.flash = flash or Flash(layout.factory)
        self.settled = False

    @property
    def stored(self) -> bytearray:
        """What the EEPROM holds by now."""
        return self.flash.cells

    @property
    def wear(self) -> Counter[int]:
        """How often each EEPROM byte has been written."""
        return self.flash.wear

    @property
    def commits(self) -> list[Commit]:
        """What will be stored if the supply lasts: moment (s), address and value, in order."""
        return self.flash.commits

    def __getitem__(self, name: str) -> int:
        """The raw value of a row."""
        layout, live = self.layout, self.live
        if name in layout.plain:  # most rows are one byte, and each packet asks for some of them
            return live[layout.plain[name]]
        word = layout.words.get(name)
        if word is not None:
            low, high, magnitude, sign = word
            code = live[low] | live[high] << 8
            return -(code & magnitude) if code & sign else code & magnitude
        entry = layout.table[name]
        return entry.decode(bytes(self.live[entry.address : entry.address + entry.size]))

    def __setitem__(self, name: str, raw: int) -> None:
        """Set the live value as the servo itself does: no lock, no access right; what does not fit is cut."""
        self.settled = False
        self.tell(name, raw)

    def tell(self, name: str, raw: int) -> None:
        """The same for feedback, which nothing that the servo does depends on."""
        layout, live = self.layout, self.live
        word = layout.words.get(name)
        if word is not None:
            low, high, magnitude, _ = word
            if 0 <= raw <= magnitude:
                live[low], live[high] = raw & 0xFF, raw >> 8
                return
        elif 0 <= raw <= 0xFF and (plain := layout.plain.get(name)) is not None:
            live[plain] = raw
            return
        entry = layout.table[name]
        self.live[entry.address : entry.address + entry.size] = code(entry, raw)

    def read(self, address: int, count: int) -> bytes:
        """Live bytes; where no register is, and beyond the last address, there are zeros."""
        found = bytes(self.live[address : address + count])
        return found if len(found) == count else found.ljust(count, b"\0")

    def write(self, address: int, data: bytes, *, locked: bool, strict: bool = False) -> Written:
        """Write what may be written. `strict` drops values outside the range of their row."""
        self.settled = False
        if strict:
            return self._write_fitting(address, data, locked)
        span, live = self.layout.span(address, len(data)), self.live
        for place, begin, end in span.pieces:
            live[place : place + end - begin] = data[begin:end]
        stored = bool(span.cells) and not locked
        if stored:
            self.flash.program([(cell, live[cell]) for cell in span.cells])
        return span.keeps if stored else span.lives

    def _write_fitting(self, address: int, data: bytes, locked: bool) -> Written:
        """Row by row, without those whose value is outside its range."""
        names = []
        cells: list[tuple[int, int]] = []
        for entry in self.layout.touched(address, len(data)):
            if not _takes(entry) or not self._fits(entry, address, data):
                continue
            names.append(entry.name)
            changed = self._put(entry, address, data)
            if entry.storage is Storage.EEPROM and not locked:
                cells += changed
        if cells:
            self.flash.program(cells)
        return Written(frozenset(names), bool(cells))

    def store(self, name: str) -> None:
        """Make the live value of a row survive a power cycle."""
        self.flash.program(self._cells(self.layout.table[name]))

    def power_up(self, *, mend: bool = False) -> None:
        """The supply was away: the EEPROM as it is stored, what was on its way there lost, the rest as at first.

        `mend` gives an id or baud rate that no servo can have, as torn cells may hold, its factory value.
        """
        self.flash.cut()
        self._begin(self.stored)
        if mend:
            for name, possible in (("id", range(_IDS)), ("baud_rate", BAUD_CODES)):
                if self[name] not in possible:
                    address = self.layout.table[name].address
                    self.live[address] = self.layout.factory[address]

    def restart(self) -> None:
        """The servo starts again by itself: as `power_up`, but what was being stored is."""
        self._begin(self.flash.intended())

    def restore_factory(self, keep: frozenset[str], time: float = 0.0) -> None:
        """Everything as shipped but the rows named; storing that takes so many seconds."""
        self.settled = False
        cells: list[tuple[int, int]] = []
        for entry in self.layout.table.values():
            if entry.name in keep or entry.storage is Storage.FACTORY:
                continue
            span = slice(entry.address, entry.address + entry.size)
            self.live[span] = self.layout.factory[span]
            if entry.storage is Storage.EEPROM and entry.writable:
                cells += self._cells(entry)
        self.flash.program(cells, time)

    def _begin(self, stored: bytearray) -> None:
        self.settled = False
        self.live[:] = self.layout.begun(stored)

    def _cells(self, entry: Register) -> list[tuple[int, int]]:
        return [(place, self.live[place]) for place in range(entry.address, entry.address + entry.size)]

    def _put(self, entry: Register, address: int, data: bytes) -> list[tuple[int, int]]:
        """Write the part of a row that lies in these bytes; gives the cells that it has."""
        places = range(max(entry.address, address), min(entry.address + entry.size, address + len(data)))
        for place in places:
            self.live[place] = data[place - address]
        return [(place, self.live[place]) for place in places]

    def _fits(self, entry: Register, address: int, data: bytes) -> bool:
        after = bytearray(self.live)
        after[address : address + len(data)] = data
        return (
            entry.low <= entry.decode(bytes(after[entry.address : entry.address + entry.size])) <= entry.high
        )


def _takes(entry: Register) -> bool:
    """Whether a host can write this row."""
    return (entry.writable and entry.storage is not Storage.FACTORY) or entry.name in _KEPT_FACTORY_ROWS


def _span(rows: tuple[Register, ...], address: int, count: int) -> Span:
    pieces: list[tuple[int, int, int]] = []
    cells: list[int] = []
    names = frozenset(row.name for row in rows if _takes(row))
    for row in rows:
        if row.name not in names:
            continue
        first, behind = max(row.address, address), min(row.address + row.size, address + count)
        if row.storage is Storage.EEPROM:
            cells += range(first, behind)
        if pieces and pieces[-1][0] - pieces[-1][1] + pieces[-1][2] == first:
            first = pieces.pop()[0]  # it goes on where the last one ends
        pieces.append((first, first - address, behind - address))
    return Span(tuple(pieces), tuple(cells), Written(names, False), Written(names, True))


def _is_word(entry: Register) -> bool:
    return entry.size == 2 and entry.coding is not Coding.TWOS_COMPLEMENT


def _word(entry: Register) -> Word:
    low, high = entry.address, entry.address + 1
    if entry.order != "little":
        low, high = high, low
    if entry.coding is Coding.SIGN_MAGNITUDE and entry.sign_bit is not None:
        return Word(low, high, (1 << entry.sign_bit) - 1, 1 << entry.sign_bit)
    return Word(low, high, 0xFFFF, 0)


def code(entry: Register, raw: int) -> bytes:
    """A raw value as the bytes of a row, cut to what its coding can say: a reading has no range but that."""
    bits = entry.sign_bit if entry.coding is Coding.SIGN_MAGNITUDE and entry.sign_bit is not None else None
    if bits is None:
        value = max(0, min(raw, (1 << 8 * entry.size) - 1))
    else:
        value = min(abs(raw), (1 << bits) - 1) | (1 << bits if raw < 0 else 0)
    return value.to_bytes(entry.size, "little" if entry.order == "little" else "big")


def _image(table: RegisterMap, defaults: Mapping[str, int]) -> bytearray:
    image = bytearray(SIZE)
    for entry in table.values():
        raw = defaults.get(entry.name, entry.default or 0)
        image[entry.address : entry.address + entry.size] = code(entry, raw)
    return image
