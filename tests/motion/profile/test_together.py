"""Moves as one: the same duration to the last digit, nobody beyond what they may, and the one to blame is named."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.profile import Kind, Limiting, Limits, Move, synchronised

QUICK = Limits(10.0, 100.0)
SLOW = Limits(0.5, 100.0)
kinds = st.sampled_from(["trapezoid", "minimum_jerk"])
limits = st.builds(Limits, st.floats(0.01, 100), st.floats(0.01, 1000), st.none() | st.floats(0.01, 1000))
places = st.floats(-100, 100)
groups = st.dictionaries(st.sampled_from("abcdefghi"), st.builds(Move, places, places, limits), min_size=1)


@given(groups, kinds, st.none() | st.floats(1, 10))
def test_all_end_together_within_their_limits(
    moves: dict[str, Move], kind: Kind, factor: float | None
) -> None:
    shortest = synchronised(moves, kind=kind).duration
    duration = None if factor is None else shortest * factor
    group = synchronised(moves, kind=kind, duration=duration)
    assert {profile.duration for profile in group.profiles.values()} == {group.duration}
    assert group.duration == (shortest if duration is None else duration)
    assert group.positions(0.0) == {name: move.start for name, move in moves.items()} or not group.duration
    assert group.positions(group.duration) == {name: move.goal for name, move in moves.items()}
    for name, move in moves.items():
        profile, may = group.profiles[name], move.limits
        hardest = max(may.acceleration, may.braking)
        for index in range(1001):
            at = group.duration * index / 1000
            assert abs(profile.velocity(at)) <= may.velocity * (1 + 1e-9)
            assert abs(profile.acceleration(at)) <= hardest * (1 + 1e-9)


@given(groups, kinds)
def test_nobody_could_do_it_quicker_than_the_one_to_blame(moves: dict[str, Move], kind: Kind) -> None:
    group = synchronised(moves, kind=kind)
    blamed = group.limited_by.axis
    if not blamed:
        assert all(move.start == move.goal for move in moves.values())
        return
    alone = synchronised({blamed: moves[blamed]}, kind=kind)
    assert alone.duration == group.duration
    others = {name: move for name, move in moves.items() if name != blamed}
    assert synchronised(others, kind=kind).duration <= group.duration
    # More of the limit that is named makes it quicker.
    start, goal, may = moves[blamed]
    more = {
        "velocity": Limits(may.velocity * 2, may.acceleration, may.deceleration),
        "acceleration": Limits(may.velocity, may.acceleration * 2, may.braking * 2),
    }
    eased = Move(start, goal, more[group.limited_by.reason])
    assert synchronised({blamed: eased}, kind=kind).duration < group.duration


@pytest.mark.parametrize("kind", ["trapezoid", "minimum_jerk"])
def test_the_reason_is_told(kind: Kind) -> None:
    far = {"lift": Move(0.0, 5.0, SLOW), "turn": Move(0.0, 5.0, QUICK)}
    near = {"lift": Move(0.0, 1e-4, SLOW), "turn": Move(0.0, 0.0, QUICK)}
    touching = {"lift": Move(0.0, 1.0, Limits(1.0, 1.0))}
    still = {"lift": Move(1.0, 1.0, SLOW)}
    assert synchronised(far, kind=kind).limited_by == Limiting("lift", "velocity")
    assert synchronised(near, kind=kind).limited_by == Limiting("lift", "acceleration")
    assert synchronised(touching, kind=kind).limited_by == Limiting("lift", "acceleration")
    assert synchronised(still, kind=kind).limited_by == Limiting("", "nothing")
    assert synchronised(far, kind=kind, duration=60.0).limited_by == Limiting("", "duration")
    quickest = synchronised(far, kind=kind).duration
    assert synchronised(far, kind=kind, duration=quickest).limited_by == Limiting("lift", "velocity")


@pytest.mark.parametrize("kind", ["trapezoid", "minimum_jerk"])
def test_one_that_has_nowhere_to_go_waits_for_the_others(kind: Kind) -> None:
    group = synchronised({"lift": Move(0.0, 1.0, SLOW), "turn": Move(2.0, 2.0, QUICK)}, kind=kind)
    assert group.profiles["turn"].duration == group.duration > 0
    assert group.positions(group.duration / 2)["turn"] == 2.0
    assert group.velocities(group.duration / 2)["turn"] == 0.0
    assert group.velocities(group.duration / 2)["lift"] > 0
    waiting = synchronised({"turn": Move(2.0, 2.0, QUICK)}, kind=kind, duration=3.0)
    assert (waiting.duration, waiting.profiles["turn"].duration) == (3.0, 3.0)


def test_nobody_at_all_is_done_at_once() -> None:
    assert (synchronised({}).duration, synchronised({}).positions(0.0)) == (0.0, {})


def test_too_little_time_is_refused_with_what_is_needed() -> None:
    moves = {"lift": Move(0.0, 5.0, SLOW), "turn": Move(0.0, 5.0, QUICK)}
    with pytest.raises(RequestError, match="2 s is too short: lift needs 10.005 s") as refused:
        synchronised(moves, duration=2.0)
    assert refused.value.expected == "10.005 s or more"
    assert "velocity limit of lift" in refused.value.cause


@given(st.floats(0.001, 1000), kinds)
def test_the_time_that_is_said_to_be_needed_is_enough(way: float, kind: Kind) -> None:
    moves = {"lift": Move(0.0, way, SLOW)}
    with pytest.raises(RequestError, match="too short") as refused:
        synchronised(moves, kind=kind, duration=0.0)
    needed = float(refused.value.expected.split()[0])
    shortest = synchronised(moves, kind=kind).duration
    assert synchronised(moves, kind=kind, duration=needed).duration == max(needed, shortest)
    assert needed <= shortest * (1 + 2e-5)


@pytest.mark.parametrize("duration", [nan, inf, -1.0])
def test_a_duration_is_a_time(duration: float) -> None:
    with pytest.raises(RequestError, match="duration is"):
        synchronised({"lift": Move(0.0, 1.0, SLOW)}, duration=duration)


@pytest.mark.parametrize(
    "move", [Move(nan, 0.0, SLOW), Move(0.0, inf, SLOW), Move(0.0, 1.0, Limits(0.0, 1.0))]
)
def test_the_axis_that_cannot_is_named(move: Move) -> None:
    for kind in ("trapezoid", "minimum_jerk"):
        with pytest.raises(RequestError, match="^lift: (start|goal|velocity) is "):
            synchronised({"turn": Move(0.0, 1.0, QUICK), "lift": move}, kind=kind)


def test_a_kind_is_one_of_two() -> None:
    kind: Any = "cubic"
    with pytest.raises(RequestError, match="'cubic' is no kind"):
        synchronised({}, kind=kind)
