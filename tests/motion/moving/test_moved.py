"""What came of a movement, told in figures and in one line."""

from __future__ import annotations

import pytest

from motorbus.motion.moving.moved import Arrived, Cycles, Moved, Track
from motorbus.motion.profile import Limiting

TRACK = Track((0.0, 0.1, 0.2, 0.3, 0.4), (0.0, 0.1, 0.2, 0.2, 0.2), (0.0, 0.06, 0.16, 0.2, 0.2))
ARRIVED = {
    "a": Arrived(0.2, 0.2, False, 0.0, 0.3, 0.0),
    "b": Arrived(1.0, 0.99, False, 0.001, 0.305, 0.0),
    "still": Arrived(0.5, 0.5, False, 0.0, 0.0, 0.5),
}


def test_a_track_tells_how_well_it_was_followed() -> None:
    assert TRACK.error == pytest.approx(0.016)
    assert TRACK.worst == pytest.approx(0.04)
    assert Track().error == Track().worst == 0.0


def test_an_axis_rests_from_the_first_sample_on_after_which_nothing_changes() -> None:
    assert TRACK.rested(0.001) == 0.3
    assert TRACK.rested(0.05) == 0.2
    assert TRACK.rested(1.0) == 0.0
    assert Track().rested(0.1) == 0.0


def test_starts_and_ends_are_compared_among_those_that_had_a_way_to_go() -> None:
    moved = Moved(0.3, ARRIVED)
    assert moved.started_apart == pytest.approx(0.001)
    assert moved.ended_apart == pytest.approx(0.005)
    assert not moved.estimated
    assert Moved(0.0, {"still": ARRIVED["still"]}).ended_apart == 0.0


def test_it_is_told_in_one_line() -> None:
    moved = Moved(0.3, ARRIVED, Limiting("b", "velocity"))
    assert str(moved) == "3 axes moved in 0.300 s, orders left within 1.0 ms and ended within 5.0 ms"
    assert str(Moved(2.0, {"a": ARRIVED["a"]})) == "1 axis moved in 2.000 s"


def test_what_was_skipped_and_what_is_only_estimated_is_told() -> None:
    lift = Arrived(0.1, 0.1, True, 0.0, 0.3, 0.0)
    moved = Moved(0.3, {"a": ARRIVED["a"], "lift": lift}, cycles={"arm": Cycles(100.0, 29, skipped=2)})
    assert moved.estimated
    assert str(moved).endswith("ended within 0.0 ms; 2 slots were skipped (lift estimated)")
