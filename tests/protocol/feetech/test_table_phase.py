"""The phase byte of each series: the same bit is a unit of velocity here and a property of the bridge there."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.table import (
    PHASE_BITS,
    TABLES,
    tells_current,
    velocity_scale,
    zero_is_maximum,
)
from motorbus.families.feetech.table.phase import many_turns_are_told, with_many_turns_told

SHIPPED = 12


@pytest.mark.parametrize(
    ("register_map", "clear", "set_"),
    [("sts", 50, 1), ("smbl", 50, 1), ("smcl", 1, 1), ("scs", 1, 1), ("scs2", 1, 1), ("hls", 1, 1)],
)
def test_bit_2_is_a_unit_of_velocity_where_it_is_one(register_map: str, clear: int, set_: int) -> None:
    for phase in range(256):
        assert velocity_scale(phase, register_map) == (set_ if phase & 4 else clear)


@pytest.mark.parametrize("register_map", ["sts", "smbl", "scs", "scs2"])
def test_bit_3_lets_velocity_0_mean_the_maximum(register_map: str) -> None:
    assert all(zero_is_maximum(phase, register_map) == bool(phase & 8) for phase in range(256))


@pytest.mark.parametrize("register_map", ["hls", "smcl"])
def test_elsewhere_velocity_0_means_standstill(register_map: str) -> None:
    assert not any(zero_is_maximum(phase, register_map) for phase in range(256))


def test_bit_5_of_sts_means_that_no_current_is_measured() -> None:
    assert tells_current(SHIPPED)
    assert not tells_current(SHIPPED | 0x20)
    assert not tells_current(SHIPPED | 0x20, "smbl")
    assert tells_current(0xFF, "hls")
    assert tells_current(0xFF, "scs2")
    assert not tells_current(0, "scs")


def test_the_rows_name_the_bits_of_their_series() -> None:
    assert set(PHASE_BITS) == set(TABLES)
    assert {name: TABLES[name]["phase"].bits for name in TABLES} == dict(PHASE_BITS)
    assert set(PHASE_BITS["scs"]) == {0, 3, 5, 6}
    assert set(PHASE_BITS["hls"]) == set(range(8))
    assert PHASE_BITS["smcl"] == {}


def test_that_bit_alone_is_set_and_cleared() -> None:
    for phase in range(256):
        on, off = with_many_turns_told(phase, True), with_many_turns_told(phase, False)
        assert (on ^ off, on & off, phase in (on, off)) == (16, phase & 0xEF, True)
        assert (many_turns_are_told(on), many_turns_are_told(off)) == (True, False)


@pytest.mark.parametrize(
    ("register_map", "told"),
    [("sts", True), ("smbl", True), ("hls", True), ("smcl", False), ("scs", False), ("scs2", False)],
)
def test_bit_4_lets_a_position_count_over_many_turns(register_map: str, told: bool) -> None:
    assert many_turns_are_told(16, register_map) is told
    assert not many_turns_are_told(0xEF, register_map)
