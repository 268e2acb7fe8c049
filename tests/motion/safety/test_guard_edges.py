"""A guard at its edges: what is just allowed and just not, ways one after the other, and who is told of an order."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest

from motorbus.core.goal import Stays, torque_off, torque_on
from motorbus.core.operation import Goal
from motorbus.errors import LimitExceeded
from motorbus.motion.safety.guard import NEAR, NOISE, ROUNDED, UNIT, Bounds, Guard
from motorbus.motion.safety.track import FRESH


def guarded(here: float | None = 0.0, bounds: Bounds = Bounds(-1.0, 2.0), **options: Any) -> Guard:  # noqa: B008
    """A guard over a device that was seen there at 10 s."""
    guard = Guard("elbow", bounds, **options)
    if here is not None and guard.track is not None:
        guard.track.take(here, 10.0)
    return guard


def goal(quantity: str, value: float, stays: Stays | None = None) -> Goal:
    return Goal(7, quantity, value, -9.0, 9.0, stays)


def passes(guard: Guard, quantity: str, value: float, *, paced: bool = True) -> bool:
    try:
        guard.check_goal(goal(quantity, value), paced=paced)
    except LimitExceeded:
        return False
    return True


# --- just allowed, and just not -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("here", "edge"), [(1.9, 2.0 + ROUNDED), (-0.9, -1.0 - ROUNDED)])
def test_a_bound_gives_way_by_what_is_rounded_and_no_farther(here: float, edge: float) -> None:
    beyond = edge * (1 + 1e-6)
    guard = guarded(here)
    assert passes(guard, "position", edge)
    assert guard.is_fine(edge, 10.0)
    assert not passes(guard, "position", beyond)
    assert not guard.is_fine(beyond, 10.0)


@pytest.mark.parametrize("bounds", [Bounds(step=0.5), Bounds(speed=0.5)])
def test_so_do_a_step_and_what_comes_without_a_speed(bounds: Bounds) -> None:
    for here in (0.0, 4.0):
        guard = guarded(here, bounds)
        far = min(bounds.step, bounds.lead) + ROUNDED
        assert far == pytest.approx(0.503)
        for way in (far, -far) if not here else (far - 1e-9,):
            assert passes(guard, "position", here + way, paced=False)
            assert passes(guard, "relative", way, paced=False)
            assert guard.is_fine(here + way, 10.0)
        assert not passes(guard, "position", here + far + 1e-6, paced=False)
        assert not guard.is_fine(here + far + 1e-6, 10.0)


def test_what_is_rounded_is_half_a_count_and_not_more() -> None:
    assert [passes(guarded(1.9), "position", to) for to in (2.0029, 2.0031)] == [True, False]
    speeds = [goal("speed", 3.0 + more) for more in (UNIT, 0.079, 0.081)]
    guard = guarded(bounds=Bounds(speed=3.0))
    for fine in speeds[:2]:
        guard.check_speed(fine)
    with pytest.raises(LimitExceeded):
        guard.check_speed(speeds[2])


@pytest.mark.parametrize("out", [2.4, -1.4, 5.0, -5.0])
def test_who_stands_outside_may_stay_there_but_for_the_noise_of_arithmetic(out: float) -> None:
    farther = 1 if out > 0 else -1
    for noise, fine in ((0.0, True), (0.8 * NOISE, True), (1.5 * NOISE, False), (1e-6, False)):
        assert passes(guarded(out), "position", out + farther * noise) is fine
    assert pytest.approx(1e-9) == NOISE


def test_a_reading_is_fresh_until_it_is_too_old_and_not_a_moment_longer() -> None:
    guard = guarded()
    assert guard.is_fine(0.1, 10.0 + FRESH)
    assert not guard.is_fine(0.1, 10.0 + FRESH + 1e-6)
    guard.check_known(7, 10.0 + FRESH)


def test_no_place_is_surely_allowed_where_nobody_knows_where_it_is() -> None:
    assert not guarded(measures=False).is_fine(0.0, 10.0)
    assert not guarded(None).is_fine(0.0, 10.0)
    suspected = guarded()
    assert suspected.track is not None
    suspected.track.take(9.0, 10.001)
    assert not suspected.is_fine(0.0, 10.001)


# --- one whose device does not tell where it is ---------------------------------------------------------------------


@pytest.mark.parametrize("far", [3.0 + ROUNDED, -3.0 - ROUNDED])
def test_of_whom_nobody_knows_where_he_is_a_way_is_as_long_as_all_of_his_at_most(far: float) -> None:
    guard = guarded(measures=False)
    assert passes(guard, "relative", far)
    assert not passes(guard, "relative", far * 1.0001)


def test_a_place_is_no_step_from_nowhere() -> None:
    guard = guarded(bounds=Bounds(-1.0, 2.0, 0.5, 0.1), measures=False)
    assert passes(guard, "position", 1.9, paced=False)
    assert not passes(guard, "position", 2.1)


def test_a_way_begins_where_it_is_reckoned_to_be_and_nobody_adds_it_up_here() -> None:
    guard = guarded(bounds=Bounds(0.0, 1.0), measures=False, reckons=lambda: 0.5)
    guard.adds(0.3)
    assert passes(guard, "relative", 0.5)
    assert not passes(guard, "relative", 0.51)
    assert not passes(guard, "position", -0.01)


# --- ways one after the other ---------------------------------------------------------------------------------------


def test_a_place_is_judged_by_itself_whatever_way_was_told_before() -> None:
    guard = guarded(0.5, Bounds(0.0, 1.0))
    guard.adds(0.4)
    assert passes(guard, "position", 0.9)
    assert not passes(guard, "relative", 0.2)
    guard.told(goal("position", 0.6))
    assert not passes(guard, "relative", 0.2), "it does not end what is under way"


def test_a_way_has_ended_when_it_is_near_its_end_and_the_next_begins_where_it_is() -> None:
    near, there = guarded(0.5, Bounds(0.0, 1.0)), guarded(0.0, Bounds(0.0, 1.0))
    near.adds(0.02)
    assert passes(near, "relative", 0.49)
    there.adds(NEAR)
    assert not passes(there, "relative", 0.95), "as near as that is not there yet"


def test_ways_are_added_to_the_end_of_the_last_and_not_to_where_it_is() -> None:
    guard = guarded(0.0, Bounds(0.0, 1.0))
    for way in (0.3, 0.4):
        assert passes(guard, "relative", way)
        guard.told(goal("relative", way))
    assert passes(guard, "relative", 0.3)
    assert not passes(guard, "relative", 0.31)
    assert not passes(guard, "relative", -0.01), "from where it is it would lead out at the other end"


@pytest.mark.parametrize("ends", ["stays", "forget"])
def test_an_order_to_stay_ends_a_way_and_a_cut_line_forgets_it(ends: str) -> None:
    guard = guarded(0.5, Bounds(0.0, 1.0))
    guard.adds(0.4)
    if ends == "stays":
        guard.told(goal("position", 0.7, Stays.STILL))
    else:
        guard.forget()
        assert guard.track is not None
        assert guard.track.sample is None
        guard.track.take(0.5, 11.0)
    assert passes(guard, "relative", 0.49)


def test_a_way_of_one_that_nobody_has_seen_leads_nowhere_known() -> None:
    guard = guarded(None, Bounds(0.0, 1.0))
    guard.adds(0.9)
    assert guard.track is not None
    guard.track.take(0.0, 10.0)
    assert passes(guard, "relative", 0.9)
    guarded(measures=False).forget()


# --- who is told ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "told"),
    [
        (goal("position", 0.3), [True]),
        (goal("position", 0.0), [True]),
        (goal("relative", 0.3), [True]),
        (goal("velocity", 0.3), [True]),
        (goal("load", 0.3), [True]),
        (goal("current", 0.3), [True]),
        (goal("velocity", 0.0), []),
        (goal("speed", 0.3), []),
        (goal("cap", 0.3), []),
        (goal("time", 0.3), []),
        (goal("position", 0.3, Stays.STILL), []),
        (goal("velocity", 0.3, Stays.STILL), []),
        (goal("position", 0.3, Stays.ON), [False]),
        (torque_on(7), [False]),
        (torque_off(7), []),
    ],
)
def test_what_moves_is_told_and_what_only_bounds_or_stays_is_not(order: Goal, told: list[bool]) -> None:
    heard: list[bool] = []
    guarded(ordered=heard.append).told(order)
    assert heard == told


def test_nothing_is_bounded_where_nobody_says_how() -> None:
    guard = guarded(0.0, Bounds())
    for value in (-1e9, 1e9):
        assert passes(guard, "position", value, paced=False)
        guard.check_speed(goal("speed", value))
    assert guard.bounds == (-inf, inf, inf, inf)
