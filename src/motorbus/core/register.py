"""Registers, objects and parameters of a device: one typed row each, and tables of rows.

Docs, completion, forms, recorder columns and the memory of simulators are derived from rows. The table of a later
model is an earlier table with differences. A row encodes and decodes its value and sends nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from enum import Enum
from typing import Literal, TypeAlias, TypeGuard

from motorbus.core.request import Effect
from motorbus.errors import RequestError

Value: TypeAlias = int | float
ByteOrder: TypeAlias = Literal["little", "big"]

_SHOWN = 40  # maximum characters of a refused value in an error


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether this is a finite number: not a bool, and no int beyond the range of float."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def shown(value: object) -> str:
    """Text of a refused value for an error, at most 40 characters and an ellipsis."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to print an int of more than 4300 digits
        return "an integer of thousands of digits"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


class Access(Enum):
    """What the host can do with a row."""

    READ = "r"
    WRITE = "w"
    READ_WRITE = "rw"


class Storage(Enum):
    """What a power cycle does to the value: EEPROM keeps it, RAM loses it; FACTORY is set by the maker."""

    EEPROM = "EEPROM"
    RAM = "RAM"
    FACTORY = "factory"


class Coding(Enum):
    """Coding of negative numbers; the sign bit of sign-magnitude is `Register.sign_bit`."""

    UNSIGNED = "unsigned"
    SIGN_MAGNITUDE = "sign-magnitude"
    TWOS_COMPLEMENT = "two's complement"


@dataclass(frozen=True, slots=True, kw_only=True)
class Register:
    """One addressable value of a device. Its value is the raw value times `scale`, in `unit`."""

    name: str
    address: int  # the register number, or the CANopen index
    size: int  # bytes
    access: Access
    storage: Storage
    source: str  # of each fact
    subindex: int | None = None
    order: ByteOrder = "little"
    coding: Coding = Coding.UNSIGNED
    sign_bit: int | None = None
    unit: str = ""  # "" for a plain number
    scale: float = 1.0
    low: int = 0  # raw, as `high`
    high: int = 0
    default: int | None = None  # the raw value as shipped, where known
    choices: Mapping[int, str] = field(default_factory=dict)  # names of single values
    bits: Mapping[int, str] = field(default_factory=dict)  # names of single bits
    effect: Effect = Effect.NONE
    protected: bool = False  # not written by name and not copied to another device
    conflict: str = ""  # what sources say where they disagree or none confirms it, and the choice made
    note: str = ""  # other facts

    @property
    def readable(self) -> bool:
        return self.access is not Access.WRITE

    @property
    def writable(self) -> bool:
        return self.access is not Access.READ

    def encode(self, raw: int, given: str = "") -> bytes:
        """Raw value -> bytes. `given` is the value as the caller wrote it, for the error.

        Raises RequestError for a raw value outside the range of the row.
        """
        if not self.low <= raw <= self.high:
            raise self.out_of_range(given or f"raw value {shown(raw)}", raw=not given)
        code = raw
        if self.coding is Coding.SIGN_MAGNITUDE and self.sign_bit is not None and raw < 0:
            code = -raw | 1 << self.sign_bit
        elif self.coding is not Coding.UNSIGNED and raw < 0:
            code = raw & (1 << 8 * self.size) - 1
        return code.to_bytes(self.size, self.order)

    def out_of_range(self, given: str, *, raw: bool = False) -> RequestError:
        """The error for a value outside the range of the row."""
        bounds = f" {self.low}..{self.high}" if raw or not self.unit else ""
        return RequestError(
            f"{self.name}: {given} is out of range{bounds}",
            expected=f"{self._shown(self.low)} to {self._shown(self.high)}",
            advice="give a value inside the range; nothing was sent",
        )

    def given(self, value: Value) -> str:
        """Text of a value in the unit of the row, for an error."""
        return f"{shown(value)} {self.unit}".rstrip()

    def decode(self, data: bytes) -> int:
        """Bytes of the right size -> raw value; a negative zero gives 0."""
        code = int.from_bytes(data, self.order)
        if self.coding is Coding.SIGN_MAGNITUDE and self.sign_bit is not None:
            magnitude = code & (1 << self.sign_bit) - 1
            return -magnitude if code >> self.sign_bit & 1 else magnitude
        if self.coding is Coding.TWOS_COMPLEMENT and code >> (8 * self.size - 1):
            return code - (1 << 8 * self.size)
        return code

    def to_value(self, raw: int) -> Value:
        """Raw value -> value in the unit of the row; the raw value itself where the row has no unit."""
        return raw * self.scale if self.unit else raw

    def to_raw(self, value: Value) -> int:
        """Value in the unit of the row -> nearest raw value.

        Raises RequestError for a value that is not finite, too large, or not whole where the row has no unit.
        """
        if is_number(value) and not math.isfinite(value / self.scale):
            raise self.out_of_range(self.given(value))
        if not (isinstance(value, bool) or is_number(value)):
            raise RequestError(
                f"{self.name}: {shown(value)} is not a finite number",
                expected=f"{self._shown(self.low)} to {self._shown(self.high)}",
                advice="give a number; nothing was sent",
            )
        if not self.unit and value != int(value):
            raise RequestError(
                f"{self.name}: {shown(value)} is not a whole number",
                expected=f"{self.low} to {self.high}",
                advice="this register has no unit; give its raw value",
            )
        return round(value / self.scale) if self.unit else int(value)

    def _shown(self, raw: int) -> str:
        return f"{self.to_value(raw):.6g} {self.unit} (raw {raw})" if self.unit else str(raw)


class RegisterMap(Mapping[str, Register]):
    """All rows of one register map, by name and by address. Immutable."""

    def __init__(self, name: str, entries: Iterable[Register], *, title: str = "") -> None:
        self.name = name
        self.title = title or name
        self._by_name = {entry.name: entry for entry in entries}
        self._by_address = {(e.address, e.subindex): e for e in self._by_name.values()}
        if len(self._by_address) != len(self._by_name):
            raise ValueError(f"table {name}: two rows share an address")

    def __getitem__(self, name: str) -> Register:
        try:
            return self._by_name[name]
        except KeyError:
            near = get_close_matches(name, self._by_name, n=3)
            raise RequestError(
                f"table {self.name} has no register {name!r}",
                expected=f"perhaps {', '.join(near)}" if near else "",
                advice="`motorbus info BUS#ID --registers` lists them; nothing was sent",
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)

    def at(self, address: int, subindex: int | None = None) -> Register | None:
        """The row that starts at this address, or None."""
        return self._by_address.get((address, subindex))

    def derive(
        self, name: str, *changed: Register, without: Iterable[str] = (), title: str = ""
    ) -> RegisterMap:
        """The table of another model: these rows, some replaced or added by name, some removed."""
        rows = {key: row for key, row in self._by_name.items() if key not in set(without)}
        rows.update({row.name: row for row in changed})
        return RegisterMap(
            name, sorted(rows.values(), key=lambda row: (row.address, row.subindex or 0)), title=title
        )


def changed(entry: Register, **differences: object) -> Register:
    """A copy of the row with some fields replaced."""
    return replace(entry, **differences)  # type: ignore[arg-type]
