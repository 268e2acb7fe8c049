"""The table says of each row what was measured, and every module of rows can be asked."""

from __future__ import annotations

from types import ModuleType

import pytest

from bench import goals
from bench.rounds import Failed
from bench.row import PROCESS, Row, Say

MET = Row("4", "something", "somebody", "x", 0.7, 0.6, 0.9, "<= 0.8", "<= 0.65", 12e-6, 17e-6, margin=PROCESS)
MISSED = Row("10", "something else", "-", "ms", 3.5, 3.0, 4.0, "< 2", note="on a busy machine", margin=0.0)


def silent(text: str) -> None:
    """Nobody watches."""


def module(name: str, *rows: Row, numbers: tuple[str, ...] | None = None) -> ModuleType:
    """A module that has measured these."""

    def measured(rounds: int, say: Say) -> list[Row]:
        return list(rows)

    found = ModuleType(name)
    vars(found)["rows"] = measured
    if numbers is not None:
        vars(found)["NUMBERS"] = numbers
    return found


def test_a_row_shows_figure_verdict_and_seconds_and_its_note_stands_below(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(goals, "reason", lambda row: "for this reason")
    assert goals.cells(MET)[2:] == ("<= 0.8, <= 0.65", "0.70, 0.60 – 0.90", "met", "12.0 / 17.0 µs")
    assert goals.cells(MISSED)[2:] == ("< 2", "3.50 ms, 3.00 – 4.00", "MISSED", "")
    rows = [MET, MISSED, MISSED._replace(measure="the same", note=""), MISSED._replace(goal="")]
    called = f"**{MISSED.number}: {MISSED.measure}**"
    assert goals.reasons(rows) == [f"{called}; **{MISSED.number}: the same**: for this reason."]
    assert goals.notes(rows) == [f"{called}; {called}: on a busy machine."]
    assert goals.cells(MET._replace(ours=2e-3))[-1] == "2000.0 / 17.0 µs"
    assert goals.cells(MET._replace(ours=2e-2))[-1] == "20.0 / 0.0 ms"
    assert len(goals.cells(MET)) == len(goals.COLUMNS)


def test_the_summary_counts_and_names_what_misses() -> None:
    assert goals.summary([MET, MISSED, MISSED]) == "1 of 3 goals are met. Missed in rows: 10."
    assert goals.summary([MET]) == "1 of 1 goals are met."
    assert goals.summary([MET, MISSED._replace(goal="")]) == "1 of 1 goals are met."


def test_rows_come_in_their_order_and_by_their_numbers() -> None:
    every = [module("b", MISSED, MET._replace(number="scale")), module("a", MET)]
    found, failures = goals.measured(7, silent, every=every)
    assert [row.number for row in found] == ["4", "10", "scale"]
    assert failures == []
    assert goals.measured(7, silent, ["4"], every) == ([MET], [])


def test_a_module_that_has_none_of_the_rows_asked_for_is_not_run() -> None:
    def fails(rounds: int, say: Say) -> list[Row]:
        raise Failed("first line\nthe last line says why")

    broken = module("broken", numbers=("8",))
    vars(broken)["rows"] = fails
    assert goals.measured(7, silent, ["4"], [broken, module("a", MET)]) == ([MET], [])
    assert goals.measured(7, silent, [], [broken, module("a", MET)]) == (
        [MET],
        ["broken: the last line says why"],
    )


def test_every_module_of_rows_has_them_and_says_how_they_are_measured() -> None:
    found = list(goals.modules())
    assert {"bench.rows.in_process", "bench.rows.on_wire", "bench.rows.paced", "bench.rows.silence"} <= {
        one.__name__ for one in found
    }
    assert all(callable(one.rows) and one.__doc__ for one in found)
