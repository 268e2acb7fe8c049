"""Up to where a flock passes an order, and what it leaves to those who look closely: each bound, met and just missed.

Who asks a gate does not see this, for what a flock does not pass is judged one by one, with the same result.
"""

from __future__ import annotations

from math import inf, nextafter
from typing import Any

import pytest

from motorbus.core.aimed import Aim
from motorbus.core.goal import Stays
from motorbus.core.operation import Answer, Exchange, Goal
from motorbus.motion.safety.flock import FLOCKS, Flock, Flocks
from motorbus.motion.safety.guard import Bounds, Guard
from motorbus.motion.safety.track import FRESH, TREMBLING, Sample

NOW = 100.0
LOW, HIGH, NEAR = Guard("n1", Bounds(-2.0, 2.0, 0.25, 3.0)).reach
FINE = Goal(1, "position", 0.5, -1.0, 1.0)


def guard(here: float | None = 0.5, at: float = NOW) -> Guard:
    """One that was seen there, then."""
    made = Guard("n1", Bounds(-2.0, 2.0, 0.25, 3.0))
    assert made.track is not None
    made.track.sample = None if here is None else Sample(here, at)
    return made


def aim(*nodes: int) -> Aim:
    return Aim(nodes, lambda _: (), lambda _: None)


def flock(*guards: Guard) -> Flock:
    nodes = tuple(range(1, len(guards) + 1))
    made = Flocks().of(aim(*nodes), dict(zip(nodes, guards, strict=True)))
    assert made is not None
    return made


def where(exchange: Exchange[Any], answer: Answer) -> Any:
    assert not isinstance(exchange.tells_position, bool)
    return exchange.tells_position(answer)


def passes(goal: Goal, its: Guard, now: float = NOW) -> bool:
    return flock(its).are_fine((goal,), {}, where, now)


@pytest.mark.parametrize(
    ("goal", "here"),
    [
        (FINE, 0.5),
        (FINE, 0.4),
        (FINE._replace(value=-0.5), -0.5),
        (FINE._replace(value=1.0), 0.9),
        (FINE._replace(value=-1.0), -0.9),
        (FINE._replace(value=NEAR), 0.0),
        (FINE._replace(value=-NEAR), 0.0),
        (FINE._replace(value=LOW, low=-9.0), -2.0),
        (FINE._replace(value=HIGH, high=9.0), 2.0),
    ],
)
def test_what_is_at_a_bound_passes(goal: Goal, here: float) -> None:
    assert passes(goal, guard(here))


@pytest.mark.parametrize(
    ("goal", "here"),
    [
        (FINE._replace(node=2), 0.5),
        (FINE._replace(quantity="speed"), 0.5),
        (FINE._replace(stays=Stays.STILL), 0.5),
        (FINE._replace(low=None), 0.5),
        (FINE._replace(high=None), 0.5),
        (FINE._replace(low=nextafter(0.5, inf)), 0.5),
        (FINE._replace(high=nextafter(0.5, -inf)), 0.5),
        (FINE._replace(value=nextafter(NEAR, inf)), 0.0),
        (FINE._replace(value=nextafter(-NEAR, -inf)), 0.0),
        (FINE._replace(value=nextafter(LOW, -inf), low=-9.0), -2.0),
        (FINE._replace(value=nextafter(HIGH, inf), high=9.0), 2.0),
    ],
)
def test_what_is_beyond_a_bound_or_of_another_kind_is_left_to_others(goal: Goal, here: float) -> None:
    assert not passes(goal, guard(here))


def test_a_reading_counts_for_as_long_as_it_is_fresh() -> None:
    assert passes(FINE, guard(at=0.0), FRESH)
    assert not passes(FINE, guard(at=0.0), nextafter(FRESH, inf))


def test_who_was_never_seen_or_cannot_be_believed_is_left_to_others() -> None:
    assert not passes(FINE, guard(None))
    doubted = guard()
    assert doubted.track is not None
    doubted.track.suspect = Sample(9.0, NOW)
    assert not passes(FINE, doubted)


@pytest.mark.parametrize("many", [0, 1, 3])
def test_goals_of_more_or_fewer_than_those_it_is_for_are_left_to_others(many: int) -> None:
    goals = tuple(FINE._replace(node=node) for node in range(1, many + 1))
    assert not flock(guard(), guard()).are_fine(goals, {}, where, NOW)


def test_all_of_them_must_be_fine() -> None:
    second = FINE._replace(node=2)
    assert flock(guard(), guard()).are_fine((FINE, second), {}, where, NOW)
    assert not flock(guard(), guard()).are_fine((FINE, second._replace(value=0.9)), {}, where, NOW)


@pytest.mark.parametrize("way", [0.0, TREMBLING / 2])
def test_a_reading_that_is_older_than_the_last_one_changes_nothing(way: float) -> None:
    its = guard()
    old = Answer((), (1,), NOW - 0.2)
    heard = {1: (Exchange[None](b"?", tells_position=lambda _: {1: 0.5 + way}), old)}
    assert flock(its).are_fine((FINE,), heard, where, NOW)
    assert its.track is not None
    assert its.track.sample == Sample(0.5, NOW)
    assert its.answer is old


def test_as_many_aims_are_kept_in_mind_as_said() -> None:
    flocks, guards = Flocks(), {1: guard()}
    aims = [aim(1) for _ in range(FLOCKS)]
    laid = [flocks.of(one, guards) for one in aims]
    assert all(flocks.of(one, guards) is its for one, its in zip(aims, laid, strict=True))


@pytest.mark.parametrize("way", [TREMBLING / 2, 2 * TREMBLING])
def test_a_reading_that_can_be_ends_a_doubt_and_is_where_it_is_now(way: float) -> None:
    its = guard(at=NOW - 0.1)
    assert its.track is not None
    its.track.suspect = Sample(9.0, NOW - 0.05)
    heard = {1: (Exchange[None](b"?", tells_position=lambda _: {1: 0.5 + way}), Answer((), (1,), NOW))}
    assert flock(its).are_fine((FINE,), heard, where, NOW)
    assert its.track.suspect is None
    assert its.track.sample == Sample(0.5 + way, NOW)


def test_one_that_is_laid_out_anew_takes_the_place_of_its_own_old_one() -> None:
    flocks, guards = Flocks(), {1: guard(), 2: guard()}
    aims = [aim(2), *(aim(1) for _ in range(FLOCKS - 1))]
    laid = [flocks.of(one, guards) for one in aims]
    guards[2] = guard()
    assert flocks.of(aims[0], guards) is not laid[0]
    assert all(flocks.of(one, guards) is its for one, its in zip(aims[1:], laid[1:], strict=True))
