"""Every row says everything, and nothing that cannot be."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest

from motorbus.core.family import Family
from motorbus.core.register import Coding, Register, Storage
from motorbus.core.request import Effect
from motorbus.core.units import QUANTITIES
from motorbus.errors import RequestError
from tests.support.world import closed, kept, locks

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def rows(family: Family) -> Iterator[Register]:
    for table in family.registers.values():
        yield from table.values()


def reach(row: Register) -> tuple[int, int]:
    """The lowest and the highest raw value that the coding can say in so many bytes."""
    if row.coding is Coding.UNSIGNED:
        return 0, (1 << 8 * row.size) - 1
    if row.coding is Coding.TWOS_COMPLEMENT:
        half = 1 << 8 * row.size - 1
        return -half, half - 1
    assert row.sign_bit is not None
    return 1 - (1 << row.sign_bit), (1 << row.sign_bit) - 1


def fits(row: Register) -> bool:
    lowest, highest = reach(row)
    return lowest <= row.low <= row.high <= highest


LAWS: dict[str, Callable[[Register], bool]] = {
    "its name is lower snake case": lambda row: NAME.fullmatch(row.name) is not None,
    "it cites a source": lambda row: bool(row.source.strip()),
    "its size is 1 to 8 bytes": lambda row: 1 <= row.size <= 8,
    "its byte order is one of two": lambda row: row.order in {"little", "big"},
    "a sign bit belongs to sign-magnitude": lambda row: (
        (row.sign_bit is not None) == (row.coding is Coding.SIGN_MAGNITUDE)
    ),
    "its sign bit lies inside": lambda row: row.sign_bit is None or 0 < row.sign_bit < 8 * row.size,
    "its range fits its coding": fits,
    "it has a range": lambda row: row.low < row.high,
    "its default is in range": lambda row: row.default is None or row.low <= row.default <= row.high,
    "its choices are in range": lambda row: all(row.low <= value <= row.high for value in row.choices),
    "its bits lie inside": lambda row: all(0 <= bit < 8 * row.size for bit in row.bits),
    "its unit is known": lambda row: row.unit in {"", *QUANTITIES},
    "its scale is positive, and 1 without a unit": lambda row: (
        row.scale > 0 and (row.unit != "" or row.scale == 1)
    ),
    "what cannot be written has no effect": lambda row: row.writable or row.effect is Effect.NONE,
    "a maker's own row is not written plainly": lambda row: (
        row.storage is not Storage.FACTORY or row.protected or not row.writable
    ),
    "EEPROM is never written without effect": lambda row: (
        row.storage is not Storage.EEPROM or not row.writable or row.effect is not Effect.NONE
    ),
    "changing an identity is protected": lambda row: row.effect is not Effect.IDENTITY or row.protected,
}


@pytest.mark.parametrize("law", LAWS)
def test_every_row_keeps_the_law(family: Family, law: str) -> None:
    assert [row.name for row in rows(family) if not LAWS[law](row)] == []


def test_there_are_tables_and_each_is_called_by_its_name(family: Family) -> None:
    assert family.registers
    assert {name: table.name for name, table in family.registers.items()} == {
        name: name for name in family.registers
    }


def test_rows_are_found_by_their_address_and_do_not_overlap(family: Family) -> None:
    for table in family.registers.values():
        assert [table.at(row.address, row.subindex) for row in table.values()] == list(table.values())
        plain = sorted(
            (row.address, row.address + row.size) for row in table.values() if row.subindex is None
        )
        assert [end for (_, end), (start, _) in pairwise(plain) if end > start] == []


def test_raw_values_become_bytes_and_come_back(family: Family) -> None:
    for row in rows(family):
        for raw in {row.low, row.low + 1, min(max(0, row.low), row.high), row.high - 1, row.high}:
            assert len(row.encode(raw)) == row.size, row.name
            assert row.decode(row.encode(raw)) == raw, row.name
            assert row.to_raw(row.to_value(raw)) == raw, row.name


def test_what_is_out_of_range_is_refused(family: Family) -> None:
    for row in rows(family):
        for raw in (row.low - 1, row.high + 1):
            with pytest.raises(RequestError, match=row.name):
                row.encode(raw)
        for value in (float("nan"), float("inf"), float("-inf")):
            with pytest.raises(RequestError, match=row.name):
                row.to_raw(value)


def test_any_bytes_have_a_raw_value(family: Family) -> None:
    for row in rows(family):
        for data in (b"\0" * row.size, b"\xff" * row.size, b"\x80" + b"\0" * (row.size - 1)):
            lowest, highest = reach(row)
            beyond = row.coding is Coding.SIGN_MAGNITUDE  # bits above the sign bit are taken as they come
            assert beyond or lowest <= row.decode(data) <= highest


def test_what_is_kept_in_eeprom_can_be_locked_and_the_lock_is_closed_as_shipped(family: Family) -> None:
    for lock in locks(family):
        assert lock.default == closed(lock)
        assert lock.effect is Effect.PERSISTENT
    for table in family.registers.values():
        assert "lock" not in table or kept(table)
