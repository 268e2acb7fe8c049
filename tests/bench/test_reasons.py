"""Every row that can be missed says why when it is, by a reason of its own, and the page shows it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from bench import apart, fleet, full_line, goals, samples
from bench.can_filled import Filled
from bench.fleet import Fleet
from bench.page import page
from bench.reasons import REASONS, reason
from bench.report import Results
from bench.rounds import CANDIDATES, Sample
from bench.row import Row
from bench.rows import can_pipeline, imports, paced, scanning, silence
from bench.workloads import WORKLOADS

SAID = {
    "seconds": 1.0,
    "processor": 1.0,
    "bytes": 1,
    "decodable": 1,
    "late": [1.0],
    "modules": 1,
    "heavy": [],
}
ALL = [
    Sample(0, name, load.name, 1e-5, 1e-3)
    for name, one in CANDIDATES.items()
    for load in WORKLOADS.values()
    if one.can(load)
]
NUMBERS = {*map(str, range(1, 16)), "scale"}


class Anything(dict[str, Any]):
    """What a process says: of whatever it is asked for, 1."""

    def __missing__(self, key: str) -> float:
        return 1.0


def every_process(
    jobs: Sequence[apart.Job], times: int, say: Callable[[str], None], *more: Any
) -> dict[str, list[Any]]:
    """Instead of `apart.rounds`: nobody runs."""
    found = {"scan": list(scanning.THERE)}
    return {job.name: [Anything(SAID, found=found.get(job.name, 1))] * times for job in jobs}


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> list[Row]:
    """All rows that the modules can give, with everybody there and nothing really measured."""
    monkeypatch.setattr(apart, "rounds", every_process)
    monkeypatch.setattr(apart.Job, "there", True)
    monkeypatch.setattr(silence, "measured", lambda times, say: every_process(silence.JOBS, times, say))
    monkeypatch.setattr(paced, "measured", lambda times, line, say: ALL)
    monkeypatch.setattr(
        samples, "in_process", lambda names, times, say: [s for s in ALL if s.contender != "bare loop"]
    )
    monkeypatch.setattr(samples, "on_wire", lambda names, times, say: ALL)
    monkeypatch.setattr(samples, "pair", lambda *words: ALL)
    monkeypatch.setattr(samples, "calls", lambda *words: {"read": 3.0})
    monkeypatch.setattr(imports, "once_opened", list)
    monkeypatch.setattr(can_pipeline, "measured", lambda *words: Filled(1.0, 1.0, 1.0, 1.0))
    line = full_line.Filled(0.25, 0.5, (100e-6,))
    monkeypatch.setattr(full_line, "LINES", [(name, lambda seconds: line) for name, _ in full_line.LINES])
    monkeypatch.setattr(fleet, "in_a_process", lambda: Fleet(10040, 2.0, 5.0, 4.0, 2.0, 0.5, 4500.0))
    found, failures = goals.measured(7, lambda text: None)
    assert failures == []
    return found


def test_every_row_that_can_be_missed_has_a_reason(rows: list[Row]) -> None:
    judged = [row for row in rows if row.goal]
    assert {row.number for row in judged} == NUMBERS == set(REASONS)
    assert [(row.number, row.measure, row.peer) for row in judged if not reason(row)] == []


def test_no_reason_is_left_over_and_none_is_said_twice(rows: list[Row]) -> None:
    said = [why for each in REASONS.values() for why in each.values()]
    assert {reason(row) for row in rows if row.goal} == set(said)
    assert len(said) == len(set(said))


def test_a_reason_has_no_figure_that_another_run_might_find_different() -> None:
    for why in (why for each in REASONS.values() for why in each.values()):
        assert not re.search(r"\d", re.sub(r"in row \d+", "", why)), why


def test_what_misses_says_so_on_the_page_with_its_reason_and_what_is_met_does_not(rows: list[Row]) -> None:
    missed = [row._replace(value=0.0 if row.goal.startswith(">") else 1e9) for row in rows if row.goal]
    machine = {"processor": "A processor", "cores": "2", "system": "Linux", "python": "CPython"}
    nothing = Results(machine, 7, [], [], None, [], [])
    lines = page(nothing._replace(rows=missed)).splitlines()
    for row in missed:
        (line,) = [one for one in lines if one.startswith(f"| {row.number}: {row.measure} | {row.peer} |")]
        assert "MISSED" in line
        against = "" if row.peer == "-" else f" / {row.peer}"
        (why,) = [one for one in lines if one.endswith(f": {reason(row)}.")]
        assert f"**{row.number}: {row.measure}{against}**" in why
    met = missed[0]._replace(value=0.0)
    assert reason(met) not in page(nothing._replace(rows=[met]))
