"""The CAN contenders: wrong values are found out, ours and theirs really run, and the page says what it says."""

from __future__ import annotations

import itertools

import pytest

from bench.can_loop import FIRST, WARM_UP, WrongValue, measure, position
from bench.can_report import COLUMNS, rows
from bench.can_rounds import CANDIDATES, WORKLOADS, run
from bench.rounds import Failed, Sample

DUE = [[position(FIRST + place, number) for number in range(1000)] for place in range(2)]


class Parrot:
    """Says what it is told to, node by node, as much of it as it is asked for."""

    def __init__(self, *values: list[int]) -> None:
        self.values = list(map(iter, values))

    def read(self, count: int) -> list[list[int]]:
        return [[next(one) for _ in range(count)] for one in self.values]

    def close(self) -> None:
        """Nothing is open."""


class Short(Parrot):
    """Keeps the last one of each to itself."""

    def read(self, count: int) -> list[list[int]]:
        return [one[:-1] for one in super().read(count)]


def test_whoever_returns_what_the_servos_say_is_measured() -> None:
    found = measure(Parrot(*DUE), 2, 200)
    assert found["wall"] > 0
    assert found["processor"] >= 0


def test_no_servo_stands_where_another_does_and_none_stands_still() -> None:
    both = list(zip(*DUE, strict=True))
    assert all(one != two for one, two in both)
    assert all(now != then for one in DUE for now, then in itertools.pairwise(one))
    assert all(-900 <= where <= 900 for one in DUE for where in one)


STALE = [[*DUE[0][:70], DUE[0][69], *DUE[0][71:]], DUE[1]]
OMITTED = [DUE[0][:70] + DUE[0][71:], DUE[1]]


@pytest.mark.parametrize(
    ("reader", "told"),
    [
        (Parrot(*STALE), "number 70"),
        (Parrot(*OMITTED), "number 70"),
        (Parrot(DUE[1], DUE[0]), "node 0x21: number 0"),
        (Parrot(DUE[0]), "of 1 nodes instead of 2"),
        (Short(*DUE), f"number {WARM_UP // 2 - 1}"),
    ],
    ids=["stale", "left out", "swapped", "a node too few", "one too few"],
)
def test_a_wrong_value_and_a_wrong_number_of_them_are_found_out(reader: Parrot, told: str) -> None:
    with pytest.raises(WrongValue, match=told):
        measure(reader, 2, 200)


@pytest.mark.parametrize("workload", WORKLOADS, ids=lambda one: one.name)
@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda one: one.name)
def test_each_reads_the_simulated_servos(candidate: object, workload: object) -> None:
    said = run(candidate, workload, 80)  # type: ignore[arg-type]
    assert said["wall"] > 0


def test_a_contender_that_fails_is_named() -> None:
    nobody = CANDIDATES[0]._replace(module="nobody")
    with pytest.raises(Failed, match="motorbus, can-read1"):
        run(nobody, WORKLOADS[0], 1)


def test_the_ratio_is_theirs_by_ours_within_a_round() -> None:
    samples = [
        Sample(number, name, workload.name, 1e-5, seconds * (number + 1))
        for number in range(3)
        for workload in WORKLOADS
        for name, seconds in (("motorbus", 1e-4), ("python-canopen", 3e-4))
    ]
    found = rows(samples)
    names = ("motorbus", "python-canopen")  # the third was not measured
    assert [row[:2] for row in found] == [(load.name, name) for load in WORKLOADS for name in names]
    assert found[1][-1] == "3.00 (3.00 – 3.00)"
    assert found[0][2:4] == ("5000", "3333 – 10000")
    assert all(len(row) == len(COLUMNS) for row in found)
