"""A CAN frame as text and as bytes."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame


def test_it_is_shown_as_people_write_it() -> None:
    assert str(CanFrame(0x60A, b"\x40\x64\x60")) == "60A#406460"
    assert str(CanFrame(0x5, b"")) == "005#"
    assert str(CanFrame(0x1ABCDE, b"\xff", extended=True)) == "001ABCDE#FF"


def test_it_lies_flat_with_identifier_count_and_data() -> None:
    assert CanFrame(0x581, b"\x01\x02").flat() == bytes.fromhex("00000581 02 0102")
    assert CanFrame(0x581, b"", extended=True).flat() == bytes.fromhex("80000581 00")
    assert CanFrame(0x581 | REMOTE_FLAG, b"").flat() == bytes.fromhex("40000581 00")
    assert CanFrame(ERROR_FLAG, b"").flat() == bytes.fromhex("20000000 00")


@given(st.integers(0, (1 << 31) - 1), st.binary(max_size=8), st.booleans())
def test_what_lies_flat_can_be_taken_apart(id: int, data: bytes, extended: bool) -> None:
    flat = CanFrame(id, data, extended).flat()
    head = int.from_bytes(flat[:4], "big")
    assert (head & ~(1 << 31), bool(head >> 31)) == (id, extended)
    assert (flat[4], flat[5:]) == (len(data), data)
