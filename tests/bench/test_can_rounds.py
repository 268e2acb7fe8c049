"""The CAN contenders: wrong values are found out, ours and theirs really run, and the page says what it says."""

from __future__ import annotations

import pytest

from bench.can_loop import STANDS, WrongValue, measure
from bench.can_report import COLUMNS, rows
from bench.can_rounds import CANDIDATES, WORKLOADS, run
from bench.rounds import Failed, Sample


class Parrot:
    """Says what it is told to."""

    def __init__(self, *values: int) -> None:
        self.values = values

    def read(self, count: int) -> list[int]:
        return list(self.values) * count

    def close(self) -> None:
        """Nothing is open."""


def test_whoever_returns_what_the_servos_say_is_measured() -> None:
    found = measure(Parrot(STANDS, STANDS), 2, 200)
    assert found["wall"] > 0
    assert found["processor"] >= 0


@pytest.mark.parametrize("values", [(STANDS, STANDS + 1), (STANDS,), (STANDS, STANDS, STANDS)])
def test_a_wrong_value_and_a_wrong_number_of_them_are_found_out(values: tuple[int, ...]) -> None:
    with pytest.raises(WrongValue):
        measure(Parrot(*values), 2, 200)


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
