"""The grid of a loop: slots stay where they are, and whatever does not keep to them is counted."""

from __future__ import annotations

import pytest

from motorbus.motion.loop.grid import Grid, Statistics, Took


def grid(rate: float = 100.0, now: float = 5.0) -> tuple[Grid, Statistics]:
    found = Statistics.of(rate, ["a1", "a2"], ["arm"])
    return Grid(found, now), found


def test_slots_are_a_period_apart_however_many_there_are() -> None:
    one, told = grid(rate=300.0)
    for number in range(3000):
        assert one.take(5.0 + number / 300) == pytest.approx(5.0 + number / 300, abs=1e-9)
        assert one.number == number
    assert (told.overruns, told.skipped) == (0, 0)


def test_who_comes_early_waits_for_its_slot() -> None:
    one, told = grid()
    one.take(5.0)
    assert one.take(5.003) == pytest.approx(5.01)
    assert told.overruns == 0


def test_who_comes_late_begins_late_in_its_own_slot() -> None:
    one, told = grid()
    one.take(5.0)
    assert one.take(5.014) == pytest.approx(5.01)
    assert (one.number, told.overruns, told.skipped) == (1, 1, 0)
    assert one.take(5.0195) == pytest.approx(5.02)  # it has caught up
    assert told.overruns == 1


def test_slots_that_have_gone_by_are_skipped_and_never_moved() -> None:
    one, told = grid()
    one.take(5.0)
    assert one.upcoming(5.0371) == 3
    assert one.take(5.0371) == pytest.approx(5.03)
    assert (one.number, told.overruns, told.skipped) == (3, 1, 2)


def test_to_the_microsecond_is_in_time() -> None:
    one, told = grid()
    one.take(5.0)
    one.take(5.0100005)
    assert told.overruns == 0
    one.take(5.0200025)
    assert told.overruns == 1


def test_time_that_was_not_the_loops_is_forgiven() -> None:
    one, told = grid()
    one.take(5.0)
    one.forgive(5.0349)
    assert one.take(5.0349) == pytest.approx(5.04)
    assert (told.overruns, told.skipped) == (0, 0)
    one.forgive(5.0)  # never back
    assert one.take(5.041) == pytest.approx(5.05)


def test_what_was_late_before_is_booked_and_only_the_rest_forgiven() -> None:
    one, told = grid()
    one.take(5.0)
    one.book(5.009)
    assert (told.overruns, told.skipped) == (0, 0)
    one.book(5.0349)
    assert (told.overruns, told.skipped) == (1, 2)
    one.forgive(5.0749)
    assert one.take(5.0749) == pytest.approx(5.08)
    assert (told.overruns, told.skipped) == (1, 2)


def test_how_long_things_took() -> None:
    took = Took()
    assert took.mean == 0.0
    for seconds in (0.001, 0.003, 0.002):
        took.add(seconds)
    assert (took.most, took.count) == (0.003, 3)
    assert took.mean == pytest.approx(0.002)


def test_statistics_say_what_people_want_to_know() -> None:
    _, told = grid()
    assert str(told).startswith("0 cycles at 100 Hz, 0 overruns, 0 slots skipped;")
    assert str(told).endswith("readings lost: none")
    told.lost["a2"] = 3
    assert str(told).endswith("readings lost: a2 3")
