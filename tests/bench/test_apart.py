"""Processes of a row: shuffled, each once a round, one spoiled one run again, two spoiled ones the end."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import pytest

from bench import apart
from bench.apart import Job
from bench.rounds import Failed, Wrong

JOBS = tuple(Job(name, "nobody") for name in "abcd")


class Course:
    """Notes who ran, and fails at the runs of these numbers."""

    def __init__(self, *failures: int) -> None:
        self.failures = failures
        self.order: list[str] = []

    def __call__(self, job: Job) -> dict[str, Any]:
        self.order.append(job.name)
        if len(self.order) - 1 in self.failures:
            raise Failed("held up")
        return {"run": len(self.order) - 1}


def silent(text: str) -> None:
    """Nobody watches."""


def test_everyone_runs_once_a_round_and_the_order_differs() -> None:
    course = Course()
    found = apart.rounds(JOBS, 3, silent, course)
    turns = [course.order[start : start + 4] for start in (0, 4, 8)]
    assert [sorted(turn) for turn in turns] == [list("abcd")] * 3
    assert len({tuple(turn) for turn in turns}) > 1
    assert {name: [one["run"] for one in said] for name, said in found.items()} == {
        name: [4 * number + turn.index(name) for number, turn in enumerate(turns)] for name in "abcd"
    }


def test_a_spoiled_process_is_run_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    course = Course(0)
    monkeypatch.setattr(apart, "repeated", Counter())
    found = apart.rounds(JOBS, 1, silent, course)
    assert len(course.order) == 5
    assert sum(len(said) for said in found.values()) == 4
    assert apart.repeated == {f"nobody: {course.order[0]}": 1}


def test_ours_is_not_run_again_when_it_was_wrong_and_theirs_is(monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[str] = []

    def run(job: Job) -> dict[str, Any]:
        runs.append(job.name)
        raise Wrong("another value")

    monkeypatch.setattr(apart, "repeated", Counter())
    for job, times in ((Job("ours", "nobody"), 1), (Job("theirs", "nobody", peers=("them",)), 2)):
        runs.clear()
        with pytest.raises(Wrong):
            apart.rounds([job], 1, silent, run)
        assert runs == [job.name] * times
    assert apart.repeated == {"nobody: theirs": 1}


@pytest.mark.parametrize(
    ("last", "kind"),
    [
        ("motorbus.errors.NoReply: servo 1 is silent", Failed),
        ("bench.loop.Late: 1 answers were late", Failed),
        ("AssertionError: somebody answered", Wrong),
        ("bench.loop.WrongValue: reading 7: [1], expected [2]", Wrong),
        ("bench.rounds.Failed: ours made other bytes", Wrong),
    ],
)
def test_a_process_says_by_its_error_whether_something_was_wrong(
    last: str, kind: type[Failed], monkeypatch: pytest.MonkeyPatch
) -> None:
    done = SimpleNamespace(returncode=1, stdout="", stderr=f"Traceback ...\n{last}\n")
    monkeypatch.setattr("bench.apart.subprocess.run", lambda *words, **named: done)
    with pytest.raises(Failed) as told:
        apart.told(JOBS[0])
    assert type(told.value) is kind


def test_what_stays_spoiled_ends_it() -> None:
    with pytest.raises(Failed, match="held up"):
        apart.rounds(JOBS, 1, silent, Course(0, 1))


def test_a_process_that_fails_is_named_with_what_it_said() -> None:
    with pytest.raises(Failed, match="ours: .*No module named bench.nobody"):
        apart.told(Job("ours", "bench.nobody"))


def test_a_job_is_there_when_its_peers_are() -> None:
    assert Job("ours", "bench.loop").there
    assert not Job("theirs", "bench.loop", peers=("nobody's library",)).there
