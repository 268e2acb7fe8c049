"""Registers as plain data and as rows."""

from __future__ import annotations

import math

import pytest

from motorbus.cli import registers
from motorbus.cli.output import Output
from motorbus.families.feetech.table import STS


def test_facts_say_all_that_a_row_says() -> None:
    (row,) = registers.facts(object(), [STS["present_position"]], {"present_position": math.pi})
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
    rows = registers.facts(object(), [STS["operating_mode"]], {"operating_mode": 1})
    registers.show("", rows, Output(), full=full)
    head, row = capsys.readouterr().out.splitlines()
    assert len(head.split()) == words
    assert "velocity" in row
