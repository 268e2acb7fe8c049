"""A spoiled measurement is repeated and said; one that stays spoiled ends the run."""

from __future__ import annotations

from typing import Any

import pytest

from bench.rounds import CANDIDATES, REPEATS, Candidate, Failed, rounds
from bench.workloads import WORKLOADS

BARE = CANDIDATES["bare loop"]


class Flaky:
    """Fails this often before it works."""

    def __init__(self, failures: int) -> None:
        self.failures = failures

    def __call__(self, candidate: Candidate, workload: str, count: int) -> dict[str, Any]:
        if self.failures:
            self.failures -= 1
            raise Failed("held up")
        return {"processor": 1.0, "wall": 2.0}


def silent(text: str) -> None:
    """Nobody watches."""


def test_everyone_does_everything_once_a_round() -> None:
    samples = rounds(Flaky(0), [BARE], count=1, times=3, progress=silent)
    assert sorted((s.round, s.workload) for s in samples) == sorted(
        (number, name) for number in range(3) for name in WORKLOADS
    )
    assert {s.repeats for s in samples} == {0}


def test_the_order_differs_from_round_to_round() -> None:
    samples = rounds(Flaky(0), list(CANDIDATES.values()), count=1, times=2, progress=silent)
    first, second = ([(s.contender, s.workload) for s in samples if s.round == n] for n in (0, 1))
    assert sorted(first) == sorted(second)
    assert first != second


def test_a_spoiled_measurement_is_repeated_and_counted() -> None:
    samples = rounds(Flaky(REPEATS), [BARE], count=1, times=1, progress=silent)
    assert [s.repeats for s in samples] == [REPEATS, 0, 0, 0]


def test_what_stays_spoiled_ends_the_run() -> None:
    with pytest.raises(Failed, match="held up"):
        rounds(Flaky(REPEATS + 1), [BARE], count=1, times=1, progress=silent)
