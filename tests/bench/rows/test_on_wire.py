"""Rows on the pseudo-terminal: what misses is measured once more, and calls are counted per exchange."""

from __future__ import annotations

from typing import Any

import pytest

from bench import samples
from bench.rounds import Sample
from bench.row import met
from bench.rows import on_wire


def sample(contender: str, workload: str, processor: float, wall: float = 1e-3, number: int = 0) -> Sample:
    return Sample(number, contender, workload, processor, wall)


def test_on_the_wire_a_row_that_misses_is_measured_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(ours: float) -> list[Sample]:
        return [sample("motorbus", "cycle", ours), sample("rustypot", "cycle", 1e-5)]

    asked: list[Any] = []

    def again(candidates: Any, workloads: Any, times: int, say: Any) -> list[Sample]:
        asked.append([one.name for one in candidates])
        return found(7e-6)

    monkeypatch.setattr(samples, "pair", again)
    goal = ("4", "cycle", "rustypot", "<= 0.80", "<= 0.65")
    first = on_wire._twice(found(9e-6), 5, print, *goal)
    assert (first.note, asked) == ("", [])  # within the margin of processes
    assert first.value == pytest.approx(0.9)
    second = on_wire._twice(found(2e-5), 5, print, *goal)
    assert second.note == "measured twice, first 2.00"
    assert second.value == pytest.approx(0.7)
    assert asked == [["motorbus", "rustypot"]]


def test_system_calls_are_the_most_of_all_sizes_and_a_cycle_is_two(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = {"cycle": {"write": 2.0, "read": 3.0, "poll": 2.0}}
    monkeypatch.setattr(samples, "calls", lambda name, load, say: counts.get(load, {"read": 3.0}))
    (row,) = on_wire.calls(print)
    assert (row.value, row.least, met(row)) == (3.5, 3.0, True)
    assert "cycle 3.5" in row.note
    counts["read1"] = {"read": 4.04}
    assert not met(on_wire.calls(print)[0])  # it is judged before it is rounded
    monkeypatch.setattr(samples, "calls", lambda name, load, say: None)
    assert on_wire.calls(lambda text: None) == []
