"""One part of the bench that fails is told, and costs the others nothing."""

from __future__ import annotations

import pytest

from bench import __main__ as bench
from bench import report, samples
from bench.page import page
from bench.rounds import Failed, Sample
from bench.row import Row, Say


def _fails() -> list[int]:
    raise Failed("somebody was silent\nand more")


def test_what_fails_is_told_by_name() -> None:
    failures: list[str] = []
    assert bench.had("a part", _fails, failures, [7]) == [7]
    assert bench.had("another", lambda: [1], failures, [7]) == [1]
    assert failures == ["a part: somebody was silent"]


def test_a_group_of_workloads_that_fails_leaves_the_others() -> None:
    def measure(names: tuple[str, ...], times: int, say: Say) -> list[Sample]:
        if "cycle" in names:
            raise Failed("held up")
        return [Sample(0, "motorbus", name, 1e-6, 1e-6) for name in names]

    failures: list[str] = []
    found = bench.of_each("in process", measure, 1, failures)
    assert {one.workload for one in found} == {*samples.BLOCKS, *samples.WRITES}
    assert failures == ["in process: held up"]


def test_a_page_of_nothing_but_failures_can_be_written() -> None:
    machine = {"processor": "A processor", "cores": "2", "system": "Linux", "python": "CPython"}
    nothing = report.Results(machine, 7, [], [], None, [], [], failures=["everything: failed"])
    assert "Not measured: everything: failed." in page(nothing)
    assert report.tables(nothing)


@pytest.mark.parametrize(("failures", "code"), [([], 0), (["rows: why"], 1)])
def test_the_exit_code_says_whether_all_was_measured(
    failures: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    row = Row("4", "something", "somebody", "x", 0.7, 0.6, 0.9, "<= 0.8")
    assert bench.printed([row], failures) == code
    said = capsys.readouterr()
    assert "1 of 1 goals are met." in said.out
    assert ("NOT MEASURED: rows: why" in said.err) is bool(failures)
