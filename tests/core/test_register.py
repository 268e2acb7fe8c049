"""Rows encode and decode values and refuse what does not fit; a table finds rows by name."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage, changed
from motorbus.core.request import Effect
from motorbus.errors import RequestError

HUGE = pytest.param(10**400, id="huge"), pytest.param(-(10**5000), id="beyond printing")
PLAIN = Register(
    name="plain",
    address=5,
    size=1,
    access=Access.READ_WRITE,
    storage=Storage.RAM,
    high=253,
    source="manual 1",
)
SIGNED = Register(
    name="goal_position",
    address=42,
    size=2,
    access=Access.READ_WRITE,
    storage=Storage.RAM,
    coding=Coding.SIGN_MAGNITUDE,
    sign_bit=15,
    unit="rad",
    scale=0.001,
    low=-32766,
    high=32766,
    effect=Effect.MOTION,
    source="manual 2",
)


@given(st.integers(-32766, 32766), st.sampled_from(["little", "big"]))
def test_sign_magnitude_round_trips_in_both_byte_orders(raw: int, order: str) -> None:
    row = changed(SIGNED, order=order)
    assert row.decode(row.encode(raw)) == raw


@given(st.integers(-128, 127))
def test_twos_complement_round_trips(raw: int) -> None:
    row = changed(PLAIN, coding=Coding.TWOS_COMPLEMENT, low=-128, high=127)
    assert row.decode(row.encode(raw)) == raw


@pytest.mark.parametrize(
    ("data", "raw"), [(b"\x01\x80", -1), (b"\x00\x80", 0), (b"\xff\x7f", 32767), (b"\x18\x05", 1304)]
)
def test_sign_magnitude_as_the_servo_writes_it(data: bytes, raw: int) -> None:
    assert SIGNED.decode(data) == raw


@pytest.mark.parametrize("raw", [-1, 254, 1000])
def test_a_raw_value_outside_its_range_is_refused(raw: int) -> None:
    with pytest.raises(RequestError, match=r"out of range 0\.\.253"):
        PLAIN.encode(raw)


def test_bits_above_the_sign_are_no_part_of_the_number() -> None:
    load = changed(SIGNED, sign_bit=10, low=-1000, high=1000)
    assert load.decode(b"\x64\xf4") == -100
    assert load.decode(b"\x64\xf0") == 100


@given(st.integers(-32766, 32766))
def test_values_have_the_unit_of_the_row(raw: int) -> None:
    assert SIGNED.to_raw(SIGNED.to_value(raw)) == raw
    assert SIGNED.to_value(raw) == pytest.approx(raw * 0.001)


def test_a_row_without_unit_takes_whole_numbers() -> None:
    assert PLAIN.to_raw(3.0) == 3
    assert PLAIN.to_value(3) == 3
    with pytest.raises(RequestError, match="not a whole number"):
        PLAIN.to_raw(3.5)


def test_a_table_finds_by_name_and_address_and_suggests() -> None:
    table = RegisterMap("t", [PLAIN, SIGNED])
    assert table["plain"] is PLAIN
    assert table.at(42) is SIGNED
    assert table.at(43) is None
    assert list(table) == ["plain", "goal_position"]
    assert "plain" in table
    assert "nothing" not in table
    with pytest.raises(RequestError, match="no register 'goal_postion'") as caught:
        table["goal_postion"]
    assert "goal_position" in caught.value.expected


def test_a_later_model_is_an_earlier_table_plus_differences() -> None:
    later = RegisterMap("t", [PLAIN, SIGNED]).derive("u", changed(PLAIN, high=252), without=["goal_position"])
    assert later.name == "u"
    assert list(later) == ["plain"]
    assert later["plain"].high == 252
    assert PLAIN.high == 253


def test_two_rows_at_one_address_are_refused() -> None:
    with pytest.raises(ValueError, match="share an address"):
        RegisterMap("t", [PLAIN, changed(SIGNED, address=5)])


@pytest.mark.parametrize("value", [1e308, -1e308, *HUGE, None, "1", 1j, [1.0], object()])
@pytest.mark.parametrize("row", [PLAIN, SIGNED])
def test_a_value_that_is_no_finite_number_is_a_bad_request(row: Register, value: Any) -> None:
    with pytest.raises(RequestError, match=r"not a finite number|out of range") as caught:
        row.encode(row.to_raw(value))
    assert len(caught.value.summary) < 400
