"""The nine axes in real time: every motor of the three processes is asked, and the figures are told plainly."""

from __future__ import annotations

import pytest

from bench.nine_axes import Spread, measured, spread, summary, table
from bench.truth import Truth, Went
from motorbus.core.plant import move, rest
from motorbus.motion.moving.moved import Arrived, Moved, Track

WENT = {"a": Went(100.0, 10.0, 12.0, 10.1, 11.9), "b": Went(-50.0, 10.002, 12.01, 10.1, 11.8)}
MOVED = Moved(
    2.0, dict.fromkeys(WENT, Arrived(1.0, 1.0, False, 0.0, 2.0, 0.0)), tracks=dict.fromkeys(WENT, Track())
)


def test_a_motor_is_judged_by_when_it_left_its_place_and_when_it_came_to_the_other() -> None:
    truth = Truth()
    truth.keep(0.0, "rest", rest(0.0, 5.0).position)
    motion = move(1.0, 5.0, 105.0, speed=100.0, acceleration=1000.0)
    truth.keep(1.0, "move", motion.position)
    truth.keep(1.5, "move", lambda at: 0.0)  # the same movement: nothing is kept
    went = truth.went(0.2, 9.0)
    assert went.way == 100.0
    assert went.first == pytest.approx(1.0, abs=0.006)
    assert went.last == pytest.approx(motion.done_at, abs=0.006)
    assert truth.where(1.6) == motion.position(1.6)


def test_the_spread_is_that_of_all_motors() -> None:
    found = spread(MOVED, WENT)
    assert found == pytest.approx((2.0, 0.002, 0.01))
    assert found.share == pytest.approx(0.005)
    assert found.good
    assert not Spread(2.0, 0.006, 0.0).good
    assert not Spread(2.0, 0.0, 0.05).good


def test_it_is_told_in_a_table_and_a_line() -> None:
    lines = list(table(MOVED, WENT))
    assert lines[2].split() == ["a", "0.00", "100.00", "1900.00", "2000.00", "0.00000"]
    assert lines[-1].startswith("starts 2.00 ms apart, ends 10.00 ms, 0.50% of the move")
    line = summary([Spread(2.0, 0.001, 0.01), Spread(2.0, 0.007, 0.03), Spread(2.0, 0.002, 0.02)])
    assert line.startswith(
        "3 movements: starts apart median 2.00 ms, most 7.00 ms; ends apart median 1.00 %, most 1.50 %"
    )
    assert line.endswith("2 within 5 ms and 2%")


def test_nine_motors_in_three_processes_move_and_are_asked_afterwards() -> None:
    ((moved, found),) = measured(1, 2.0)
    assert len(found) == 9
    assert all(one.way for one in found.values())
    assert all(one.first < one.last for one in found.values())
    assert moved.axes["slide"].estimated
