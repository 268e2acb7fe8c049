"""Paced cycles are judged by what the wire carries and by the others, and a second time where they miss."""

from __future__ import annotations

import pytest

from bench.rounds import Sample
from bench.row import met
from bench.rows import in_process, paced


def sample(contender: str, workload: str, processor: float, wall: float = 1e-3, number: int = 0) -> Sample:
    return Sample(number, contender, workload, processor, wall)


def test_paced_cycles_are_judged_by_the_wire_and_by_the_others() -> None:
    limit = 1 / paced.limit(50e-6)
    assert limit == pytest.approx(930e-6)
    found = [
        sample("motorbus", "cycle", 4e-5, limit / 0.95),
        sample("rustypot", "cycle", 5e-5, limit / 0.93),
        sample("feetech-servo-sdk", "cycle", 1e-3, limit / 0.9),
        sample("bare loop", "cycle", 1e-5, limit / 0.97),
    ]
    share, rate, rust, vendor = paced.judged(found, paced.LINES[1])
    assert (share.unit, share.note) == ("%", "bare loop: 97.0 %")
    assert share.value == pytest.approx(95)
    assert rate.value == pytest.approx(0.95 / 0.93)
    assert [rust.value, vendor.value] == pytest.approx([0.8, 0.04])
    assert [row.number for row in (share, rate, rust, vendor)] == ["6", "6", "7", "7"]
    assert all(met(row) for row in (share, rate, rust, vendor))
    assert not met(paced.judged([found[0]._replace(wall=limit / 0.929)], paced.LINES[1])[0])  # no margin


def test_only_what_missed_is_taken_from_the_second_time() -> None:
    one = in_process.against(
        "1", [sample("motorbus", "read1", 1e-6), sample("x", "read1", 2e-6)], "read1", "<= 0.6", ""
    )
    bad, good = one._replace(value=3.0), one._replace(value=0.4)
    first, second = paced.anew([one, bad], [good, good])
    assert first == one
    assert (second.value, second.note) == (0.4, "measured twice, first 3.00")
    assert paced.anew([one, bad], []) == [one, bad]  # a peer that could not be measured again


def test_both_ways_to_hand_over_an_answer_are_measured_against_the_same_goals_and_named() -> None:
    burst, later, pieces = paced.LINES
    assert (burst.turnaround, burst.goal, burst.stretch) == (pieces.turnaround, pieces.goal, pieces.stretch)
    assert [line.pieces for line in paced.LINES] == [False, False, True]
    assert burst.named == "1 Mbaud, turnaround 0 µs, answers in one burst"
    assert later.named == "1 Mbaud, turnaround 50 µs, answers in one burst"
    found = [sample("motorbus", "cycle", 4e-5), sample("rustypot", "cycle", 5e-5)]
    assert [row.measure for row in paced.judged(found, pieces)] == [
        "1 Mbaud, turnaround 0 µs, answers in pieces: of the wire limit",
        "1 Mbaud, turnaround 0 µs, answers in pieces: cycle rate",
        "1 Mbaud, turnaround 0 µs, answers in pieces: processor time per cycle",
    ]
