"""A spoiled measurement is repeated and said; one that stays spoiled ends the run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bench.rounds import CANDIDATES, REPEATS, Candidate, Failed, Wrong, in_memory, rounds
from bench.workloads import WORKLOADS

BARE = CANDIDATES["bare loop"]


class Flaky:
    """Fails this often before it works."""

    def __init__(self, failures: int, kind: type[Failed] = Failed) -> None:
        self.failures = failures
        self.kind = kind

    def __call__(self, candidate: Candidate, workload: str, count: int) -> dict[str, Any]:
        if self.failures:
            self.failures -= 1
            raise self.kind("held up")
        return {"processor": 1.0, "wall": 2.0}


def silent(text: str) -> None:
    """Nobody watches."""


def test_everyone_does_everything_once_a_round() -> None:
    samples = rounds(Flaky(0), [BARE], count=1, times=3, progress=silent)
    assert sorted((s.round, s.workload) for s in samples) == sorted(
        (number, name) for number in range(3) for name, load in WORKLOADS.items() if BARE.can(load)
    )
    assert {s.repeats for s in samples} == {0}


def test_the_order_differs_from_round_to_round() -> None:
    samples = rounds(Flaky(0), list(CANDIDATES.values()), count=1, times=2, progress=silent)
    first, second = ([(s.contender, s.workload) for s in samples if s.round == n] for n in (0, 1))
    assert sorted(first) == sorted(second)
    assert first != second


def test_a_spoiled_measurement_is_repeated_and_counted() -> None:
    two = [WORKLOADS["read1"], WORKLOADS["cycle"]]
    samples = rounds(Flaky(REPEATS), [BARE], count=1, times=1, progress=silent, workloads=two)
    assert [s.repeats for s in samples] == [REPEATS, 0]


def test_nobody_is_asked_for_what_it_has_no_call_for() -> None:
    found = rounds(Flaky(0), [CANDIDATES["servolab"]], count=1, times=1, progress=silent)
    assert {s.workload for s in found} == {
        "read1",
        "sync-read-6x15",
        "sync-read-6x15-raw",
        "sync-write-6x6",
        "sync-write-30x6",
    }


def test_what_stays_spoiled_ends_the_run_if_it_is_ours() -> None:
    with pytest.raises(Failed, match="held up"):
        rounds(Flaky(REPEATS + 1), [CANDIDATES["motorbus"]], count=1, times=1, progress=silent)


def test_ours_is_not_tried_again_when_it_was_wrong() -> None:
    with pytest.raises(Wrong):
        rounds(Flaky(1, Wrong), [CANDIDATES["motorbus"]], count=1, times=1, progress=silent)


def test_another_is_tried_again_even_then() -> None:
    samples = rounds(Flaky(1, Wrong), [BARE], 1, 1, silent, workloads=[WORKLOADS["read1"]])
    assert [s.repeats for s in samples] == [1]


def test_a_wrong_value_in_a_process_is_told_from_one_that_could_not_do_its_work(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def says(text: str) -> None:
        done = SimpleNamespace(returncode=1, stderr=text, stdout="")
        monkeypatch.setattr("bench.rounds.subprocess.run", lambda *words, **named: done)

    says("wrong value: reading 7: [1], expected [2]")
    with pytest.raises(Wrong, match="bare loop, read1: wrong value: reading 7"):
        in_memory(BARE, "read1", 5)
    says("1 answers were late; 1 readings of a servo left out")
    with pytest.raises(Failed, match="late") as told:
        in_memory(BARE, "read1", 5)
    assert not isinstance(told.value, Wrong)


def test_another_that_stays_spoiled_is_left_out_of_this_round_and_said() -> None:
    two = [WORKLOADS["read1"], WORKLOADS["cycle"]]
    told: list[str] = []
    samples = rounds(Flaky(REPEATS + 1), [BARE], count=1, times=1, progress=told.append, workloads=two)
    assert len(samples) == 1
    assert "left out of round 1: held up\n" in told


@pytest.mark.parametrize("name", [one.name for one in CANDIDATES.values() if one.in_memory])
def test_each_library_in_python_really_reads_and_writes(name: str) -> None:
    candidate = CANDIDATES[name]
    load = next(one for one in reversed(WORKLOADS.values()) if candidate.can(one))
    assert in_memory(candidate, load.name, 5)["processor"] > 0
