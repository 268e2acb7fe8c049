"""Registers as plain data and as rows."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from motorbus import families
from motorbus.cli import registers
from motorbus.cli.output import Output
from motorbus.families.feetech import FAMILY
from motorbus.families.feetech.table import STS

ONE = SimpleNamespace(bus=SimpleNamespace(family=FAMILY))


def test_facts_say_all_that_a_row_says() -> None:
    (row,) = registers.facts(ONE, [STS["present_position"]], {"present_position": math.pi})
    assert row == {
        "name": "present_position",
        "address": 56,
        "value": math.pi,
        "unit": "rad",
        "raw": 2048,
        "meaning": "",
        "storage": "RAM",
        "access": "r",
    }


@pytest.mark.parametrize(("full", "words"), [(False, 4), (True, 7)])
def test_a_table_is_brief_or_full(full: bool, words: int, capsys: pytest.CaptureFixture[str]) -> None:
    rows = registers.facts(ONE, [STS["operating_mode"]], {"operating_mode": 1})
    registers.show("", rows, Output(), full=full)
    head, row = capsys.readouterr().out.splitlines()
    assert len(head.split()) == words
    assert "velocity" in row


def test_an_object_of_a_dictionary_has_its_index_and_sub_index(capsys: pytest.CaptureFixture[str]) -> None:
    table = families.load("kst").tables["kst"]
    one = SimpleNamespace(bus=SimpleNamespace(family=families.load("kst")))
    raw = int.from_bytes(b"V1.2", "little")
    rows = registers.facts(one, [table["firmware_version"]], {"firmware_version": raw})
    assert (rows[0]["address"], rows[0]["subindex"], rows[0]["meaning"]) == (0x100A, 0, "V1.2")
    registers.show("", rows, Output(), full=True)
    assert "0x100A:00" in capsys.readouterr().out
