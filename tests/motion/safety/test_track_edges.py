"""The last that is believed, that is still, or that a motor bears, and the first that is not."""

from __future__ import annotations

from math import inf, nan, nextafter
from typing import Any

import pytest

from motorbus.core.family import Quality, State
from motorbus.core.goal import Goal, Later
from motorbus.core.operation import Pause
from motorbus.errors import RequestError, WireError
from motorbus.motion.safety.standstill import Rest, Standstill
from motorbus.motion.safety.strain import TURNING, Bearable, Strain, Verdict
from motorbus.motion.safety.track import (
    FRESH,
    MARGIN,
    REACH,
    READINGS,
    STAYED,
    TREMBLING,
    Sample,
    Track,
    believed,
)
from motorbus.motion.safety.turning import Turning
from motorbus.motion.safety.waiting import Waiting

# --- readings -------------------------------------------------------------------------------------------------------


def seen(value: float = 0.0, at: float = 0.0, speed: float = 2.0) -> Track:
    track = Track(speed)
    track.take(value, at)
    return track


@pytest.mark.parametrize("sign", [1, -1])
def test_as_far_as_a_motor_comes_with_its_margin_is_believed(sign: int) -> None:
    farthest = 2.0 * 0.05 * MARGIN + TREMBLING
    assert seen().take(sign * farthest, 0.05).quality is Quality.FRESH
    assert seen().take(sign * (farthest + 1e-9), 0.05).quality is Quality.SUSPECT


def test_the_speed_counts_for_a_short_time_and_after_a_long_one_only_who_has_stayed_is_believed() -> None:
    reached = 2.0 * REACH * MARGIN + TREMBLING
    assert seen().take(reached, FRESH).quality is Quality.FRESH
    assert seen().take(reached + 1e-9, FRESH).quality is Quality.SUSPECT
    later = nextafter(FRESH, 1.0)
    assert seen().take(STAYED, later).quality is Quality.FRESH
    assert seen().take(STAYED + 1e-9, later).quality is Quality.SUSPECT


def test_trembling_at_the_very_moment_is_believed_and_a_leap_is_not() -> None:
    assert seen().take(TREMBLING, 0.0).quality is Quality.FRESH
    assert seen().take(-TREMBLING, 99.0).quality is Quality.FRESH
    assert seen().take(TREMBLING + 1e-9, 0.0).quality is Quality.SUSPECT


def test_the_mirror_of_a_place_is_another_place() -> None:
    assert seen(5.0).take(-5.0, 0.01).quality is Quality.SUSPECT


def test_what_is_believed_again_ends_all_doubt() -> None:
    for value in (0.0, 0.05):
        track = seen()
        track.take(5.0, 0.02)
        assert track.why_not(0.02) == "suspect"
        assert track.take(value, 0.03).quality is Quality.FRESH
        assert track.suspect is None
        assert track.why_not(0.03) == ""
        assert track.sample == Sample(value, 0.03)


def test_a_reading_from_before_changes_nothing() -> None:
    track = seen(at=1.0)
    for value in (0.0, 5.0):
        assert track.take(value, 0.5) == Sample(0.0, 1.0, Quality.REPEATED)
        assert (track.sample, track.suspect) == (Sample(0.0, 1.0), None)


def test_a_doubt_from_later_is_not_confirmed_by_what_came_before_it() -> None:
    track = seen()
    track.take(5.0, 0.041)
    assert track.take(5.0, 0.04).quality is Quality.SUSPECT
    assert track.take(5.0, 0.04).quality is Quality.CONFIRMED, "and by one of the same moment it is"


def test_no_number_is_a_doubt_that_displaces_none() -> None:
    track = seen()
    assert track.take(nan, 0.01) == pytest.approx(Sample(nan, 0.01, Quality.SUSPECT), nan_ok=True)
    assert track.why_not(0.01) == "suspect"
    track.take(5.0, 0.02)
    for value in (inf, -inf, nan):
        assert track.take(value, 0.03).quality is Quality.SUSPECT
        assert track.suspect == Sample(5.0, 0.02, Quality.SUSPECT)


def test_a_reading_is_fresh_for_half_a_second_and_repeated_at_once() -> None:
    track = seen(at=1.0)
    assert track.why_not(1.0 + FRESH) == ""
    assert track.why_not(1.0 + FRESH + 1e-9) == "stale"
    assert track.latest(1.0) == Sample(0.0, 1.0)
    assert track.latest(1.25) == Sample(0.0, 1.0, Quality.REPEATED)
    assert Track().latest(1.0) is None
    assert Sample(0.0, 1.0).age(1.25) == 0.25
    assert Sample(0.0, 1.0).age(0.5) == 0.0


def test_what_is_forgotten_is_unseen() -> None:
    track = seen()
    track.take(5.0, 0.01)
    track.forget()
    assert (track.sample, track.suspect, track.why_not(0.01)) == (None, None, "unseen")


def test_three_readings_that_do_not_agree_are_told_and_no_fourth_is_asked_for() -> None:
    readings = iter((5.0, 9.0, 13.0, 17.0))
    track = seen()

    def ask() -> Any:
        yield from ()
        return next(readings)

    work = believed(track, ask)

    def carried_out() -> None:
        asked: Any = next(work)
        for moment in range(1, 99):
            assert isinstance(asked, Pause)
            assert asked.seconds == 0, "the time is asked for, and nobody waits"
            asked = work.send(moment / 100)

    with pytest.raises(WireError, match="do not agree: 5, 9, 13 rad"):
        carried_out()
    assert next(readings) == 17.0
    assert READINGS == 3


# --- rest -----------------------------------------------------------------------------------------------------------


def judge(*samples: tuple[float, float], quality: Quality = Quality.FRESH) -> Standstill:
    found = Standstill(still=0.5, span=0.25, reads=3)
    for value, at in samples:
        found.take(Sample(value, at, quality))
    return found


def test_enough_readings_over_the_whole_span_prove_rest() -> None:
    assert judge((0.0, 0.0), (0.5, 0.125), (0.0, 0.25)).rest is Rest.STOPPED
    assert not judge((0.0, 0.0), (0.0, 0.25)).rests
    assert not judge((0.0, 0.0), (0.0, 0.125), (0.0, 0.24)).rests
    assert judge((0.0, 0.0), (0.75, 0.125), (0.75, 0.25)).rest is Rest.MOVING


def test_a_reading_that_is_no_new_one_proves_nothing() -> None:
    assert not judge((0.0, 0.0), (0.0, 0.5), (0.0, 0.5)).rests
    assert not judge((0.0, 0.0), (0.0, 0.5), (0.0, 0.375)).rests
    assert not judge((0.0, 0.0), (0.0, 0.125), (0.0, 0.5), quality=Quality.REPEATED).rests


def test_what_cannot_be_believed_takes_back_what_was_seen() -> None:
    found = judge((0.0, 0.0), (0.0, 0.125), (0.0, 0.25))
    assert found.rests
    assert not found.take(Sample(0.0, 0.375, Quality.SUSPECT))
    assert found.rest is Rest.UNSEEN
    assert not found.take(Sample(0.0, 0.5))


# --- strain ---------------------------------------------------------------------------------------------------------

BEARABLE = Bearable(load=0.5, current=2.0, off=0.25, seconds=1.0, hot=64.0, cool=60.0)


HARD: dict[str, Any] = {"load": 1.0, "position": 0.0}


def strained(goal: float | None = 1.0, **sample: Any) -> bool:
    strain = Strain(BEARABLE)
    return strain.take(State(0.0, **{"position": 0.0, **sample}), goal) is Verdict.STRAINED


def test_what_is_just_too_much() -> None:
    assert strained(load=0.5)
    assert strained(load=-0.5)
    assert not strained(load=0.499)
    assert strained(current=2.0)
    assert strained(current=-2.0)
    assert not strained(current=1.999)


def test_whoever_is_at_his_goal_or_has_none_is_not_strained() -> None:
    assert strained(load=0.5, position=0.749)
    assert not strained(load=0.5, position=0.75)
    assert not strained(load=0.5, position=1.25)
    assert not strained(None, load=0.5)


def test_load_counts_for_what_stands_and_current_for_what_turns_too() -> None:
    assert strained(load=0.5, velocity=TURNING)
    assert not strained(load=0.5, velocity=TURNING + 0.01)
    assert not strained(load=0.5, velocity=-TURNING - 0.01)
    assert strained(current=2.0, velocity=9.0)


def test_strain_counts_from_its_beginning_and_an_overload_stays_until_it_is_reset() -> None:
    strain, easy = Strain(BEARABLE), State(6.5, load=0.0, position=0.0)
    told = [strain.take(State(at, **HARD), 1.0) for at in (5.0, 5.999, 6.0)]
    assert told == [Verdict.STRAINED, Verdict.STRAINED, Verdict.OVERLOADED]
    told = [strain.take(easy, 1.0)]
    strain.reset()
    told.append(strain.verdict)
    strain.take(State(7.0, **HARD), 1.0)
    strain.reset()
    assert [*told, strain.verdict] == [Verdict.OVERLOADED, Verdict.EASY, Verdict.EASY]


def test_a_clock_that_goes_back_begins_the_strain_anew() -> None:
    strain = Strain(BEARABLE)
    for at in (5.0, 1.0):
        strain.take(State(at, **HARD), 1.0)
    assert strain.since == 1.0
    assert strain.take(State(2.0, **HARD), 1.0) is Verdict.OVERLOADED


def test_heat_stays_until_it_is_cool_and_an_overload_is_told_before_it() -> None:
    strain = Strain(BEARABLE)
    told = [strain.take(State(at, temperature=of), None) for at, of in enumerate((63.9, 64.0, 60.0, 59.9))]
    assert told == [Verdict.EASY, Verdict.HOT, Verdict.HOT, Verdict.EASY]
    strain.take(State(5.0, temperature=64.0), None)
    assert strain.take(State(6.0), None) is Verdict.HOT, "one that tells no temperature is as hot as it was"
    strain.reset()
    told = [strain.verdict, *(strain.take(State(at, **HARD), 1.0) for at in (7.0, 8.0))]
    assert told == [Verdict.HOT, Verdict.HOT, Verdict.OVERLOADED]


def test_only_figures_that_mean_something_are_taken() -> None:
    for wrong in ({"load": 0.0}, {"current": -1.0}, {"seconds": inf}, {"cool": 66.0}, {"hot": nan}):
        with pytest.raises(RequestError):
            Strain(Bearable(**wrong))
    assert Bearable(load=inf, hot=60.0, cool=60.0).checked().load == inf


# --- what goes on, and what waits -----------------------------------------------------------------------------------


def test_what_goes_on_ends_with_the_stop_that_is_accepted_or_when_that_very_order_rests() -> None:
    accepted = {1: 0, 2: 0}
    turning = Turning(accepted.__getitem__)
    turning.begins(1)
    first = turning.last(1)
    assert turning.goes_on(1)
    assert not turning.goes_on(2)
    turning.begins(1)
    turning.rests(1, first)
    assert turning.goes_on(1), "one that came after it goes on"
    turning.rests(1, None)
    turning.rests(2, first)
    assert turning.goes_on(1)
    accepted[1] = 1
    assert not turning.goes_on(1)
    turning.begins(1)
    turning.rests(1, turning.last(1))
    assert not turning.goes_on(1)


def test_where_nobody_counts_stops_only_rest_ends_it() -> None:
    turning = Turning()
    turning.begins(1)
    assert turning.goes_on(1)
    turning.rests(1, turning.last(1))
    assert not turning.goes_on(1)


def test_what_is_handed_over_or_let_begin_is_not_acknowledged_yet() -> None:
    waiting, goal = Waiting(), Goal(1, "position", 0.5, -1.0, 1.0)
    later, begins = Later(1), Later(None, begins=True)
    later.done = begins.done = True
    waiting.take(later, (goal,), 3)
    assert not later.done
    waiting.begin(begins)
    assert not begins.done
    found = waiting.of(Later(1, begins=True))
    assert found is not None
    assert (found[0].goals, found[0].stops) == ((goal,), 3)


def test_a_copy_knows_what_was_handed_over_before_and_nothing_later() -> None:
    waiting, goal = Waiting(), Goal(1, "position", 0.5, -1.0, 1.0)
    waiting.take(Later(1), (goal,), 0)
    copy = waiting.copy()
    waiting.take(Later(2), (goal,), 0)
    assert copy.of(Later(1, begins=True)) is not None
    assert copy.of(Later(2, begins=True)) is None
