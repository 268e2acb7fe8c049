"""A reading counts when a motor can have come there, and for as long as somebody keeps asking."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import Quality
from motorbus.core.steps import Sleep
from motorbus.errors import WireError
from motorbus.motion.safety.track import FASTEST, FRESH, MARGIN, REACH, TREMBLING, Sample, Track, believed

QUICK = st.floats(-FASTEST, FASTEST)


def test_the_first_reading_has_nothing_to_disagree_with() -> None:
    track = Track()
    assert track.why_not(0.0) == "unseen"
    assert track.take(1.0, 0.0) == Sample(1.0, 0.0, Quality.FRESH)
    assert track.why_not(0.0) == ""


def test_what_no_motor_can_have_done_is_suspect_and_is_not_where_it_is() -> None:
    track = Track(speed=5.0)
    track.take(0.0, 0.0)
    assert track.take(1.0, 0.01).quality is Quality.SUSPECT
    assert track.why_not(0.01) == "suspect"
    assert track.sample == Sample(0.0, 0.0)
    assert track.suspect == Sample(1.0, 0.01, Quality.SUSPECT)


def test_a_second_reading_that_agrees_confirms_it() -> None:
    track = Track(speed=5.0)
    track.take(0.0, 0.0)
    track.take(1.0, 0.01)
    assert track.take(1.005, 0.02).quality is Quality.CONFIRMED
    assert track.why_not(0.02) == ""
    assert track.sample is not None
    assert track.sample.value == 1.005


def test_a_second_reading_that_agrees_with_the_ones_before_refutes_it() -> None:
    track = Track(speed=5.0)
    track.take(0.0, 0.0)
    track.take(1.0, 0.01)
    assert track.take(0.01, 0.02).quality is Quality.FRESH
    assert (track.why_not(0.02), track.suspect) == ("", None)


def test_two_suspect_readings_that_disagree_confirm_nothing() -> None:
    track = Track(speed=5.0)
    track.take(0.0, 0.0)
    track.take(1.0, 0.01)
    assert track.take(-1.0, 0.02).quality is Quality.SUSPECT
    assert track.why_not(0.02) == "suspect"


def test_two_readings_at_one_moment_are_judged_too() -> None:
    track = Track()
    track.take(1.0, 1.0)
    assert track.take(1.005, 1.0).quality is Quality.FRESH
    assert track.take(2.0, 1.0).quality is Quality.SUSPECT
    assert track.take(2.0, 1.0).quality is Quality.CONFIRMED


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_what_is_no_number_is_suspect_and_confirms_nothing(value: float) -> None:
    track = Track()
    assert track.take(value, 0.0).quality is Quality.SUSPECT
    assert track.take(value, 0.1).quality is Quality.SUSPECT
    assert track.sample is None
    assert track.take(1.0, 0.2).quality is Quality.FRESH


USUAL: dict[str, Any] = {}
TEN: dict[str, Any] = {"speed": 10.0}


@pytest.mark.parametrize(
    ("told", "seconds", "comes", "cannot"),
    [
        (USUAL, 0.05, 1.3, 1.75),  # no servo is said to do more than 60 degrees, 1.05 rad, in that time
        (TEN, 0.05, 0.65, 0.87),  # it does 0.5 rad, and half as much again is let through
        (TEN, 0.3, 0.78, 1.05),  # its speed counts for 0.06 s only
        (USUAL, 0.4, 1.6, 2.1),
        (USUAL, 0.0, 0.008, 0.012),  # what trembles; a count of the coarsest servo is 0.0051 rad
        (USUAL, 0.6, 0.08, 0.12),  # nobody has looked for more than half a second: only whoever has stayed
        (USUAL, 1e5, 0.08, 0.12),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_how_far_a_motor_comes(
    told: dict[str, Any], seconds: float, comes: float, cannot: float, sign: int
) -> None:
    for way, quality in ((comes, Quality.FRESH), (cannot, Quality.SUSPECT)):
        track = Track(**told)
        track.take(3.0, 0.0)
        assert track.take(3.0 + sign * way, seconds).quality is quality


def test_what_was_read_less_than_half_a_second_ago_needs_no_second_look() -> None:
    track = Track()
    track.take(1.0, 1.0)
    assert (track.why_not(1.4), track.why_not(1.6)) == ("", "stale")


def test_an_older_reading_changes_nothing() -> None:
    track = Track()
    track.take(1.0, 1.0)
    assert track.take(5.0, 0.5) == Sample(1.0, 1.0, Quality.REPEATED)
    assert track.sample == Sample(1.0, 1.0)


def test_later_on_it_is_a_repeated_one_with_its_age() -> None:
    track = Track()
    assert track.latest(0.0) is None
    track.take(1.0, 1.0)
    assert track.latest(1.0) == Sample(1.0, 1.0)
    later = track.latest(1.2)
    assert later is not None
    assert later.quality is Quality.REPEATED
    assert later.age(1.2) == pytest.approx(0.2)


def test_it_is_stale_after_a_while() -> None:
    track = Track()
    track.take(1.0, 1.0)
    assert track.why_not(1.0 + FRESH) == ""
    assert track.why_not(1.0 + FRESH + 1e-6) == "stale"


def test_what_was_forgotten_is_unseen_and_may_come_back_anywhere() -> None:
    track = Track()
    track.take(1.0, 1.0)
    track.forget()
    assert track.why_not(1.0) == "unseen"
    assert track.take(-300.0, 1.001).quality is Quality.FRESH


@given(st.floats(-100, 100), st.lists(st.tuples(st.floats(1e-4, REACH), QUICK), max_size=30))
def test_nothing_that_a_motor_does_while_somebody_looks_is_ever_suspect(
    start: float, ways: list[tuple[float, float]]
) -> None:
    track, at, place = Track(), 0.0, start
    track.take(place, at)
    for seconds, speed in ways:
        at, place = at + seconds, place + speed * seconds
        assert track.take(place, at).quality is Quality.FRESH


@given(st.floats(-100, 100), st.lists(st.tuples(st.floats(1e-4, 10.0), QUICK), max_size=30))
def test_whatever_a_motor_does_a_second_look_confirms_it(
    start: float, ways: list[tuple[float, float]]
) -> None:
    track, at, place = Track(), 0.0, start
    track.take(place, at)
    for seconds, speed in ways:
        at, place = at + seconds, place + speed * seconds
        if track.take(place, at).quality is Quality.SUSPECT:
            at, place = at + 0.001, place + speed * 0.001
            assert track.take(place, at).quality is Quality.CONFIRMED


@pytest.mark.parametrize("seconds", [0.07, 0.25, 0.5, 0.6, 10.0, 1e5])
def test_one_reading_does_not_say_that_it_has_gone_far_while_nobody_looked(seconds: float) -> None:
    track = Track()
    track.take(1.0, 1.0)
    assert track.take(3.0, 1.0 + seconds).quality is Quality.SUSPECT
    assert track.take(1.02, 1.001 + seconds).quality is Quality.FRESH
    assert track.sample is not None
    assert track.sample.value == 1.02


@given(st.floats(0, 10), st.floats(1e-4, 1.0), st.floats(1e-3, 100), st.sampled_from([-1, 1]))
def test_whatever_is_farther_than_physics_allows_is_suspect(
    start: float, seconds: float, beyond: float, sign: int
) -> None:
    track = Track(speed=7.0)
    track.take(start, 3.0)
    there = start + sign * (7.0 * seconds * MARGIN + TREMBLING + beyond)
    assert track.take(there, 3.0 + seconds).quality is Quality.SUSPECT
    assert track.sample == Sample(start, 3.0)


@given(st.lists(st.tuples(st.floats(1e-3, 0.3), st.floats(allow_nan=True)), max_size=30))
def test_what_is_believed_is_always_a_number_and_was_told(readings: list[tuple[float, float]]) -> None:
    track, at = Track(), 0.0
    for seconds, value in readings:
        at += seconds
        sample = track.take(value, at)
        assert sample.at == at
        assert track.sample is None or abs(track.sample.value) < inf
        assert (track.why_not(at) == "") == (sample.quality in (Quality.FRESH, Quality.CONFIRMED))


def reading(*angles: float) -> float:
    """What is told of a device that was seen at 0, and then is read at these, 10 ms apart."""
    track, left, at = Track(), list(angles), 1.0
    track.take(0.0, at)

    async def ask() -> float:
        return left.pop(0)

    steps = believed(track, ask)
    try:
        assert isinstance(steps.send(None), Sleep)
        while True:
            at += 0.01
            steps.send(at)
    except StopIteration as end:
        assert not left
        found: float = end.value
        return found


def test_a_place_is_told_where_a_motor_can_have_come_there_or_a_second_reading_agrees() -> None:
    assert reading(0.1) == 0.1
    assert reading(2.0, 0.1) == 0.1
    assert reading(2.0, 2.001) == 2.001
    assert reading(2.0, 4.0, 4.001) == 4.001


def test_readings_of_which_none_agrees_are_not_told() -> None:
    with pytest.raises(WireError, match="do not agree: 2, 4, 6 rad"):
        reading(2.0, 4.0, 6.0)
