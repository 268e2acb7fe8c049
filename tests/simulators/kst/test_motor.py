"""The shaft: counts, zero, sense of rotation."""

from __future__ import annotations

import pytest

from motorbus.families.kst.simulator.motor import Shaft


def shaft(position: int = 0) -> Shaft:
    return Shaft(0.0, position, speed=1000.0, acceleration=10_000.0)


def test_a_trapezoid_ends_exactly_at_its_goal() -> None:
    one = shaft()
    one.move(900, 0.0)
    assert one.motion.velocity(0.5) == 1000.0
    assert one.motion.done_at == pytest.approx(1.0)
    assert (one.reading(0.5), one.reading(1.001)) == (450, 900)


def test_a_new_goal_takes_over_from_the_motion_under_way() -> None:
    one = shaft()
    one.move(900, 0.0)
    one.move(-900, 0.5)
    assert one.motion.velocity(0.5) == 1000.0
    assert one.reading(0.55) > 450
    assert one.reading(10.0) == -900


def test_a_halt_is_at_once_and_where_it_is() -> None:
    one = shaft()
    one.move(900, 0.0)
    one.halt(0.5)
    assert (one.reading(0.5), one.reading(9.0)) == (450, 450)


def test_zero_and_sense_change_the_reading_and_not_the_shaft() -> None:
    one = shaft(300)
    one.set_zero(1.0)
    assert one.reading(1.0) == 0
    one.reversed = True
    one.turn_by_hand(50, 1.0)
    assert (one.reading(1.0), one.motion.position(1.0)) == (50, 250)


def test_a_reading_fits_sixteen_bits() -> None:
    one = shaft(40_000)
    assert one.reading(0.0) == 32767
    one.reversed = True
    assert one.reading(0.0) == -32768
