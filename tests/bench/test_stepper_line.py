"""The stepper's jobs on a paced pseudo-terminal: they are really done, and what is said of them is what they took."""

from __future__ import annotations

import pytest

from bench.stepper_line import (
    BACKUP,
    BYTE,
    COLUMNS,
    COMMAND,
    DUMP,
    ONE_NUMBER,
    TEN_STEPS,
    Sample,
    program,
    rows,
    samples,
    verdict,
)

FOUND = [
    Sample(ONE_NUMBER, 1.0, 1.1, 0.9),
    Sample(ONE_NUMBER, 1.2, 1.1, 0.9),
    Sample(BACKUP, 2.0, 1.9, 1.9),
]


def test_each_job_is_done_and_takes_at_least_the_time_of_its_bytes() -> None:
    found = samples(1, lambda text: None)
    assert [one.job for one in found] == [TEN_STEPS, ONE_NUMBER, BACKUP]
    assert found[1].bytes_alone == pytest.approx((3 * COMMAND + 4 * DUMP) * BYTE)
    assert all(one.took >= one.bytes_alone and one.said > 0 for one in found)


def test_there_is_a_row_for_each_job() -> None:
    told = rows(FOUND)
    assert [row[0] for row in told] == [ONE_NUMBER, BACKUP]
    assert all(len(row) == len(COLUMNS) for row in told)
    assert told[0][1:5] == ("1.100 s", "1.000 – 1.200", "1.100 s", "1.000 (0.909 – 1.091)")


def test_the_verdict_is_of_the_one_that_was_farthest_off() -> None:
    assert verdict(FOUND).endswith("10.0%. At most 15%: reached.")
    assert "MISSED" in verdict([*FOUND, Sample(BACKUP, 1.0, 1.2, 1.0)])


def test_the_program_has_ten_steps_and_one_number_to_choose() -> None:
    one, other = program(10).project, program(11).project
    assert one.total_steps == 10
    assert one.with_step(10, delay=11) == other
