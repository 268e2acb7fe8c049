"""The manual's 29 refusals word by word, CiA 301's two more, and codes nobody knows."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.families.kst.wire import ABORTS, abort_text
from tests.families.kst.vectors import MANUAL, Vector, name_of

PRINTED = [vector for vector in MANUAL if vector.kind == "abort"]


def swapped(code: int) -> int:
    return int.from_bytes(code.to_bytes(4, "little"), "big")


def test_the_manual_prints_29_and_cia_301_has_two_more() -> None:
    printed = {int(vector.expected["code"], 16) for vector in PRINTED}
    assert len(printed) == 29
    assert set(ABORTS) - printed == {0x060A_0023, 0x0800_0024}
    assert len(ABORTS) == 31


@pytest.mark.parametrize("vector", PRINTED, ids=name_of)
def test_the_words_are_the_manuals(vector: Vector) -> None:
    assert abort_text(int(vector.expected["code"], 16)) == vector.expected["text"]


def test_no_code_is_another_one_byte_reversed() -> None:
    assert {code for code in ABORTS if swapped(code) in ABORTS} == set()


@pytest.mark.parametrize("code", ABORTS, ids=hex)
def test_a_byte_swapped_code_is_recognised(code: int) -> None:
    text = abort_text(swapped(code))
    assert text.startswith("byte-swapped abort")
    assert ABORTS[code] in text
    assert f"0x{code:08X}" in text


@given(st.integers(0, 0xFFFF_FFFF))
def test_every_code_has_words_and_an_unknown_one_its_number(code: int) -> None:
    text = abort_text(code)
    assert text
    assert code in ABORTS or f"0x{code:08X}" in text


def test_a_vendors_own_code_is_shown() -> None:
    assert abort_text(0x0F00_0009) == "unknown abort code 0x0F000009"
