"""The rows of scale: their figures are medians, and their notes say what was found."""

from __future__ import annotations

import pytest

from bench import fleet, full_line
from bench.fleet import Fleet
from bench.full_line import Filled
from bench.row import met
from bench.rows import scale
from bench.rows.scale import fleet_row, line_row

FULL = Filled(0.25, 0.5, (100e-6,) * 98 + (900e-6, 5e-3))
FLEET = Fleet(10040, 2.0, 5.0, 4.0, 2.0, 0.5, 4500.0)


def test_a_line_is_told_in_percent_of_a_core() -> None:
    row = line_row("some servos", [FULL, FULL._replace(core=0.75), FULL._replace(core=0.5)])
    assert (row.value, row.least, row.greatest, row.unit, row.samples) == (100.0, 50.0, 150.0, "%", 3)
    assert "wire 50.0% full; of 300 answers half come within 100 µs" in row.note
    assert "99.00% within 1 ms; the latest 5.0 ms" in row.note
    assert met(row._replace(value=99.0))


def test_a_line_that_takes_more_than_a_core_misses() -> None:
    assert not met(line_row("some servos", [FULL._replace(core=1.3)]))


def test_a_fleet_is_told_by_how_much_faster_it_is() -> None:
    row = fleet_row([FLEET, FLEET._replace(processor=1.0), FLEET._replace(processor=4.0)])
    assert (row.value, row.least, row.greatest, row.unit) == (2.0, 1.0, 4.0, "x")
    assert "2 goals and read 5 times a second" in row.note
    assert "50 µs of processor time for its second; built in 0.5 s, 4.5 kB of memory" in row.note
    assert met(row)
    assert not met(fleet_row([FLEET._replace(processor=8.0)]))


def test_there_are_three_rows_of_as_many_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(full_line, "LINES", (("a", lambda seconds: FULL), ("b", lambda seconds: FULL)))
    monkeypatch.setattr(fleet, "in_a_process", lambda: FLEET)
    said: list[str] = []
    found = scale.rows(6, said.append)
    assert [(row.number, row.samples) for row in found] == [("scale", 6)] * 3
    assert len(said) == 18
    assert len(scale.rows(1, said.append)[0].measure) > 0
