"""The page of the machine file, and the JSON Schema beside it, are the ones that the types would make today."""

from __future__ import annotations

import json
import re

import pytest

from motorbus.motion.machine import Machine, keys, schema
from scripts import machine_file

PAGE = machine_file.page()


def test_page_and_schema_are_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["machine_file", "--check"])
    assert machine_file.main() == 0, "python -m scripts.machine_file makes them"


def test_every_key_is_on_the_page() -> None:
    for rows in (keys.FILE, keys.BUS, keys.AXIS, keys.GROUP):
        assert [name for name in rows if f"\n| `{name}` | {rows[name].says} |" not in PAGE] == []


def test_the_example_is_a_machine() -> None:
    example = re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)
    assert [list(Machine.parse(text).axes) for text in example] == [["shoulder", "slide"]]


def test_the_schema_is_the_one_of_the_program() -> None:
    assert json.loads(machine_file.SCHEMA.read_text(encoding="utf-8")) == schema()


def test_a_cell_never_breaks_a_table() -> None:
    widths = {line.count("|") for line in PAGE.splitlines() if line.startswith("|")}
    assert widths == {3, 4, 7}


def test_what_is_not_current_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_file, "text_of_schema", lambda: "{}")
    monkeypatch.setattr("sys.argv", ["machine_file", "--check"])
    assert machine_file.main() == 1
