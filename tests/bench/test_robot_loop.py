"""The measurement of the loop: a real one, on a line that takes its time, and what is told is what was counted."""

from __future__ import annotations

import math
import os
from itertools import pairwise

import pytest

from bench.responder import build
from bench.robot_loop import (
    COLUMNS,
    KINDS,
    LOOKS,
    STEP,
    Sample,
    Wrong,
    counted,
    course,
    described,
    is_urgent,
    judged,
    rows,
    sample,
    urgent,
    verdict,
)
from bench.workloads import to_and_fro
from motorbus.motion.machine import Machine

STEADY = Sample("followed ahead", 909.1, 1136.4, 909.1, 54546, 0, 0, 4e-6, 950e-6, 120e-6)
FLAT = Sample("followed ahead", 1136.4, 1136.4, 1020.0, 5100, 5000, 500, 400e-6, 970e-6, 120e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_a_loop_of_six_axes_on_a_wire_that_takes_its_time(kind: str) -> None:
    found = sample(build(), kind, 100.0, 0.5)
    assert found.wire == pytest.approx(1e6 / 880)
    assert found.cycles >= 1
    assert found.cycle >= 880e-6  # no reading can be there sooner
    assert (found.kind, found.asked) == (kind, 100.0)
    assert found.urgent == is_urgent()  # as this process


NOBODY: frozenset[str] = frozenset()


def test_every_reading_is_one_more() -> None:
    judged([({"a1": number * STEP}, NOBODY) for number in range(10)])
    judged([({"a1": (number + (number >= 5)) * STEP}, NOBODY) for number in range(10)])  # how the motor fares
    for wrong in (3, 4, 5 + LOOKS + 1):
        counts = [wrong if number == 5 else number for number in range(10)]
        with pytest.raises(Wrong, match=r"cycle 5: a1 shows \d+, 1 readings after \d+"):
            judged([({"a1": count * STEP}, NOBODY) for count in counts])


def test_at_the_end_of_its_range_a_servo_counts_down() -> None:
    half = counted(0.0)
    readings = [({"a1": (to_and_fro(number) - half) * STEP}, NOBODY) for number in range(half, 3 * half)]
    assert max(here["a1"] for here, _ in readings) > readings[-1][0]["a1"] + math.pi / 2
    judged(readings)
    with pytest.raises(Wrong):
        judged([*readings, readings[-2]])


def test_a_reading_that_was_told_as_lost_is_one_that_was_asked() -> None:
    lost = [({"a1": 0.0}, NOBODY), ({"a1": 0.0}, frozenset({"a1"})), ({"a1": 2 * STEP}, NOBODY)]
    judged(lost)
    with pytest.raises(Wrong, match=r"cycle 2: a1 shows \d+, 2 readings after \d+"):
        judged([*lost[:2], ({"a1": STEP}, NOBODY)])


def test_the_goals_are_within_what_an_axis_may_do() -> None:
    ways = course(2000)
    machine = Machine.parse(described("/dev/null"))
    assert set(ways[0].values()) == {0.0}
    for name, spec in machine.axes.items():
        fastest = max(abs(after[name] - before[name]) for before, after in pairwise(ways))
        assert fastest * 1136 < spec.max_velocity
        assert max(way[name] for way in ways) < math.radians(100)


def test_priority_is_given_back() -> None:
    before = os.sched_getscheduler(0)
    with urgent() as permitted:
        assert is_urgent() == permitted
        assert (os.sched_getscheduler(0) == os.SCHED_FIFO) == permitted
    assert not is_urgent()
    assert os.sched_getscheduler(0) == before


def test_the_verdict_is_of_the_worst() -> None:
    told = verdict([STEADY, FLAT])
    assert "highest rate: 0 in 54546 cycles. None: reached." in told
    assert "Achieved of what the wire carries: 89.8%. At least 88%: reached." in told
    assert "1 in 109092 cycles. None: MISSED." in verdict([STEADY, STEADY._replace(skipped=1), FLAT])
    assert "Real-time priority: not permitted here" in told
    urgent_ones = [one._replace(urgent=True) for one in (STEADY, FLAT)]
    assert verdict(urgent_ones).endswith("Real-time priority: granted.")
    assert "not permitted" in verdict([*urgent_ones, FLAT])
    assert "79.2%. At least 88%: MISSED." in verdict([STEADY, FLAT, FLAT._replace(achieved=900.0)])


def test_loops_that_are_not_ahead_are_told_and_not_judged() -> None:
    others = [one._replace(kind="direct", achieved=700.0, skipped=7) for one in (STEADY, FLAT)]
    told = verdict([STEADY, FLAT, *others])
    assert "89.8%. At least 88%: reached." in told
    assert "Not ahead: 7 in 54546 cycles, and 61.6%." in told


def test_there_is_a_row_for_each() -> None:
    told = rows([STEADY, FLAT])
    assert all(len(row) == len(COLUMNS) for row in told)
    assert told[1] == ("followed ahead", "1136.4", "1020.0", "89.8%", "5000", "500", "400", "970", "120")
