"""The page of FEETECH registers, and the JSON beside it, are the ones that the rows would make today."""

from __future__ import annotations

import json
import re

import pytest

from motorbus.families.feetech.table import MODELS, TABLES
from scripts import feetech_registers


def test_page_and_database_are_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["feetech_registers", "--check"])
    assert feetech_registers.main() == 0, "python -m scripts.feetech_registers makes them"


def test_every_row_of_every_map_is_on_the_page() -> None:
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## )", feetech_registers.page(), re.M | re.S))
    for name, table in TABLES.items():
        rows = re.findall(r"^\| (\d+) \| `(\w+)` \| ([12]) \|", sections[name], re.M)
        assert [(int(address), row, int(size)) for address, row, size in rows] == [
            (row.address, row.name, row.size) for row in table.values()
        ]


def test_every_model_is_on_the_page() -> None:
    for (major, minor), model in MODELS.items():
        assert f"| {major}.{minor} | {model.name} |" in feetech_registers.page()


def test_the_database_is_json_with_every_row() -> None:
    told = json.loads(feetech_registers.DATABASE.read_text(encoding="utf-8"))
    assert told["schema"] == "motorbus.feetech.registers/1"
    assert {one["name"]: [row["name"] for row in one["registers"]] for one in told["maps"]} == {
        name: list(table) for name, table in TABLES.items()
    }


def test_a_cell_never_breaks_the_table() -> None:
    lines = [line for line in feetech_registers.page().splitlines() if line.startswith("|")]
    widths = {line.count("|") for line in lines}
    assert widths == {4, 8, 15}


def test_what_is_not_current_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feetech_registers, "text_of_database", lambda: "{}")
    monkeypatch.setattr("sys.argv", ["feetech_registers", "--check"])
    assert feetech_registers.main() == 1
