"""Ours is taken by whoever of the others needs least, round by round."""

from __future__ import annotations

import pytest

from bench import samples
from bench.rounds import Sample
from bench.rows import in_process


def sample(contender: str, workload: str, processor: float, wall: float = 1e-3, number: int = 0) -> Sample:
    return Sample(number, contender, workload, processor, wall)


def test_the_best_peer_is_whoever_needs_least() -> None:
    found = [
        sample("motorbus", "read1", 1e-6),
        *(sample("slow", "read1", 9e-6, number=n) for n in range(3)),
        *(
            sample("quick", "read1", 5e-6 * (1 + 9 * (n == 2)), number=n) for n in range(3)
        ),  # slow in one round
        sample("other", "cycle", 1e-9),
    ]
    assert samples.best(found, "read1") == "quick"
    with pytest.raises(ValueError, match=r"empty"):
        samples.best(found, "sync-read-30x2")


def test_in_process_ours_is_taken_by_the_best_of_the_others() -> None:
    found = [
        one
        for number, load in enumerate((1.0, 7.0))  # a machine that gets slower
        for one in (
            sample("motorbus", "read1", 2e-6 * load, number=number),
            sample("quick", "read1", 4e-6 * load, number=number),
            sample("slow", "read1", 5e-6 * load, number=number),
        )
    ]
    row = in_process.against("1", found, "read1", "<= 0.85", "<= 0.7")
    assert (row.peer, row.samples) == ("quick", 2)
    assert row.value == pytest.approx(0.5)
    assert row.ours == pytest.approx(8e-6)
