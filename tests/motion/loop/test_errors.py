"""What a loop says went wrong: what was asked, what can be, and what to do."""

from __future__ import annotations

from math import inf, nan
from types import SimpleNamespace
from typing import Any

import pytest

from motorbus.core.units import GREATEST_RATE, LEAST_RATE
from motorbus.errors import RequestError
from motorbus.motion.loop.errors import as_number, check_loop, never_ahead, not_ahead, silence, stopped


@pytest.mark.parametrize("rate", [0.0, -5.0, nan, inf, 1e-9, 1e9])
def test_a_rate_that_cannot_be_is_told_with_what_can(rate: float) -> None:
    with pytest.raises(RequestError, match=f"^rate is {rate}\n") as caught:
        check_loop(rate, direct=False, jerk=None)
    assert caught.value.expected == "cycles per second: 1e-06 to 1e+06"


@pytest.mark.parametrize("rate", ["x", None, True, [50.0], pytest.param(10**400, id="10**400")])
def test_what_is_no_number_is_no_rate(rate: Any) -> None:
    with pytest.raises(RequestError, match="^rate is .*\n.*expected: a number"):
        check_loop(rate, direct=False, jerk=None)


def test_every_other_rate_is_left_to_whoever_knows_the_bus() -> None:
    check_loop(GREATEST_RATE, direct=False, jerk=None)
    check_loop(LEAST_RATE, direct=False, jerk=None)


def test_jerk_is_for_goals_that_are_followed() -> None:
    check_loop(100.0, direct=False, jerk=5.0)
    with pytest.raises(RequestError, match="jerk is said of goals that are sent as they are"):
        check_loop(100.0, direct=True, jerk=5.0)


@pytest.mark.parametrize("goal", ["1", None, True, [1.0], pytest.param(10**400, id="10**400")])
def test_what_is_no_number_is_no_goal(goal: object) -> None:
    assert as_number("a1", 1) == 1.0
    with pytest.raises(RequestError, match=r"the goal of a1 is"):
        as_number("a1", goal)


def test_where_no_loop_can_be_ahead_it_is_told_why() -> None:
    assert "these are on arm, can: each bus waits for itself" in str(not_ahead(["arm", "can"]))
    assert "these are on can: there the answers of several are awaited at once" in str(not_ahead(["can"]))


def test_on_an_event_loop_none_can_be_ahead() -> None:
    told = never_ahead()
    assert "AsyncRobot" in told.summary
    assert "use a Robot" in told.advice


def test_who_was_stopped_and_who_is_silent_is_named() -> None:
    assert "a1, a2: stopped from elsewhere" in str(stopped(["a1", "a2"]))
    places: Any = {"a1": SimpleNamespace(heard=3.0)}
    told = str(silence(["a1"], 31, places, 3.25))
    assert "a1: no reading in 31 cycles of the loop" in told
    assert "a1 for 0.25 s" in told
