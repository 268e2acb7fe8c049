"""Along a trajectory: whatever its rows are, the goals that are sent keep the limits, or none is sent."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import cos, inf, nan, radians, tau
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorbus.core.steps import Procedure
from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.machine import AxisSpec
from motorbus.motion.moving.along import Led, Paced, judged
from motorbus.motion.moving.moved import Moved
from motorbus.motion.moving.stream import Stream
from motorbus.motion.profile.shapes import trapezoid
from motorbus.motion.trajectory import Interpolation, Trajectory, Waypoint, interpolated
from motorbus.motion.trajectory.limits import SLACK
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import listened, machine, said

LIMIT = radians(360)
SPEED = radians(90)
COARSE = "time (s),a1 (deg)\n0,0\n1,{0}\n2,-{0}\n3,0\n"
KINDS: tuple[Interpolation, ...] = ("linear", "cubic", "spline", "minimum_jerk")
AXIS = AxisSpec(device="arm#1", unit="deg", low=-2.0, high=2.0, max_velocity=SPEED, max_acceleration=LIMIT)


def hardest(times: Sequence[float], goals: Sequence[float]) -> float:
    """The highest acceleration from one goal to the next (rad/s²)."""
    rates = [
        (there - here) / (later - at)
        for (at, here), (later, there) in pairwise(zip(times, goals, strict=True))
    ]
    spans = [(end - begin) / 2 for begin, end in zip(times, times[2:], strict=False)]
    return max(
        abs(after - before) / span for (before, after), span in zip(pairwise(rates), spans, strict=True)
    )


def sent(moved: Moved, name: str = "a1") -> float:
    """How hard the goals of an axis were on its way, from rest."""
    track = moved.tracks[name]
    return hardest([-0.02, -0.01, *track.times], [track.goals[0]] * 2 + [*track.goals])


def taught(rate: float, acceleration: float = 340, way: float = 40) -> Trajectory:
    """A trapezoid (deg, deg/s²) as it is taught at `rate` (Hz): at rest before, and it begins between two rows."""
    ramp = trapezoid(0.0, radians(way), velocity=0.95 * SPEED, acceleration=radians(acceleration))
    times = [number / rate for number in range(int((ramp.duration + 0.3) * rate))]
    return Trajectory(times, {"a1": [ramp.position(max(0.0, at - 0.113)) for at in times]})


# -- what is sent ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "rate"),
    [(Trajectory.parse(COARSE.format(20)), None), (taught(50), None), (taught(100, 300), 400.0)],
    ids=["coarse rows", "rows at 50 Hz", "goals at 400 Hz"],
)
def test_rows_that_are_coarser_than_goals_are_led_within_the_acceleration(
    rows: Trajectory, rate: float | None
) -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        moved = robot.replay(rows, rate=rate)
        assert 0.4 * LIMIT < sent(moved) <= LIMIT * (1 + SLACK)
        assert moved.cycles["arm"].rate == pytest.approx(rate or 100.0, rel=0.01)
        assert moved.tracks["a1"].goals[-1] == rows.axes["a1"][-1]


@pytest.mark.parametrize(
    ("rows", "options", "told"),
    [
        (
            Trajectory.parse(COARSE.format(45)),
            {},
            r"acceleration at \d.* s is .* deg/s², and its limit is 360 deg",
        ),
        (
            Trajectory.parse(COARSE.format(20)),
            {"interpolation": "linear"},
            "acceleration at 0 s is 4000 deg/s²",
        ),
        (taught(50, 355), {"interpolation": "linear"}, "acceleration at 0.12 s"),
        (taught(100, 355), {"speed": 1.05}, "acceleration at 0.12"),
        (taught(100, 355), {"interpolation": "linear", "rate": 400.0}, "acceleration"),
    ],
)
def test_goals_that_would_be_too_hard_are_refused_before_anything_is_sent(
    rows: Trajectory, options: dict[str, Any], told: str
) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        with pytest.raises(LimitExceeded, match=f"a1: its {told}") as refused:
            robot.replay(rows, **options)
        assert "scaled(2)" in str(refused.value)
        assert said(sims) == []


def test_a_movement_beyond_the_outermost_row_is_seen() -> None:
    """A spline turns back beyond a row; where that is beyond the limit of the axis it is refused."""
    peak = Trajectory([0.0, 4.0, 8.0, 12.0], {"a1": [0.0, 1.99, 1.99, 0.0]})
    with pytest.raises(LimitExceeded, match=r"a1: its position at 4\.\d+ s is 11[4-9]"):
        judged(peak.joined(), {"a1": AXIS}, 100.0)
    assert max(judged(peak.joined("cubic"), {"a1": AXIS}, 100.0).axes["a1"]) == 1.99


def test_async_is_led_within_the_acceleration_too() -> None:
    async def main() -> Moved:
        with machine(arm="1") as (made, _):
            async with AsyncRobot.of(made) as robot:
                with pytest.raises(LimitExceeded):
                    await robot.replay(Trajectory.parse(COARSE.format(45)))
                moved: Moved = await robot.replay(Trajectory.parse(COARSE.format(20)))
                return moved

    assert 0.4 * LIMIT < sent(asyncio.run(main())) <= LIMIT * (1 + SLACK)


def test_a_route_is_led_as_it_is_and_not_by_its_samples() -> None:
    route = interpolated([Waypoint({"a1": 0.0}), Waypoint({"a1": 0.3}, at=1.003)], "minimum_jerk")
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        track = robot.replay(route, rate=200.0).tracks["a1"]
        off = [route.positions(at)["a1"] - goal for at, goal in zip(track.times, track.goals, strict=True)]
        assert max(map(abs, off)) < 1e-4


def test_a_kind_or_a_rate_that_is_none_is_refused() -> None:
    rows, kind = Trajectory.parse(COARSE.format(20)), cast(Any, "quintic")
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        with pytest.raises(RequestError, match="'quintic' is no kind"):
            robot.replay(rows, interpolation=kind)
        for rate in (nan, 0.0, -1.0, inf):
            with pytest.raises(RequestError, match="rate is"):
                robot.replay(rows, rate=rate)
        assert said(sims) == []


class Orders:
    """The goals of `a1` on a way along a course, as they left: of each, the moment for which it is (s)."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.goals: dict[float, float] = {}
        order = Stream._order

        def noted(stream: Stream, at: float) -> Procedure[None]:
            course = stream._course
            if isinstance(course, Led):
                self.goals[at] = course.positions(at)["a1"]
            return order(stream, at)

        patch.setattr(Stream, "_order", noted)


GAPS = st.one_of(
    st.lists(st.floats(0.002, 0.3), min_size=1, max_size=12),
    st.builds(
        lambda gap, count: [gap] * count, st.sampled_from([0.005, 0.01, 0.02, 0.1]), st.integers(1, 20)
    ),
)


@settings(max_examples=40, deadline=None)
@given(
    GAPS,
    st.lists(st.floats(-1.0, 1.0), min_size=21, max_size=21),
    st.sampled_from([0.0, 0.001, 0.02, 0.2]),
    st.sampled_from(KINDS),
    st.sampled_from([None, 30.0, 100.0, 250.0]),
    st.sampled_from([0.5, 1.0, 1.7]),
)
def test_whatever_the_rows_are_what_is_sent_keeps_the_limits(
    gaps: list[float],
    rough: list[float],
    much: float,
    kind: Interpolation,
    rate: float | None,
    speed: float,
) -> None:
    times = [0.0, *accumulate(gaps)]
    swing = 0.2 * min(1.0, times[-1]) ** 2
    smooth = [swing * (1 - cos(tau * at / times[-1])) / 2 for at in times]
    places = [place + much * off for place, off in zip(smooth, rough, strict=False)]
    with machine(arm="1") as (made, sims), Robot.of(made) as robot, pytest.MonkeyPatch.context() as patch:
        listened(sims)
        orders = Orders(patch)
        try:
            robot.replay(Trajectory(times, {"a1": places}), speed=speed, rate=rate, interpolation=kind)
        except LimitExceeded:
            assert not orders.goals
            assert not [one for one in said(sims) if "WRITE" in one]
            return
        (first, *_), goals = orders.goals, {-1.0: places[0], 0.0: places[0]} | orders.goals
        goals = {(-first if at < 0 else at): goal for at, goal in goals.items()}
        assert hardest([*goals], [*goals.values()]) <= LIMIT * (1 + 2 * SLACK)
        assert hardest([*goals, max(goals) + first], [*goals.values(), places[-1]]) <= LIMIT * (1 + 2 * SLACK)
        assert max(map(abs, goals.values())) <= radians(150)


# -- as values ---------------------------------------------------------------------------------------------------------


def test_goals_of_several_rates_are_one_course() -> None:
    rows = Trajectory([0.0, 0.5, 1.0], {"a1": [0.0, 0.1, 0.0], "c1": [0.0, 0.2, 0.0]})
    parts = [judged(rows.joined(), {name: AXIS}, rate) for name, rate in (("a1", 100.0), ("c1", 40.0))]
    both = Led(parts)
    assert both.duration == 1.0
    assert [len(part.times) for part in parts] == [101, 41]
    assert both.positions(0.5) == pytest.approx({"a1": 0.1, "c1": 0.2})


def test_half_as_fast_takes_twice_the_time_and_ends_where_it_ends() -> None:
    slow = Paced(Trajectory([0.0, 0.7], {"a1": [0.0, 0.1]}), 0.3)
    assert slow.duration == pytest.approx(0.7 / 0.3)
    assert slow.positions(slow.duration) == {"a1": 0.1}
    assert slow.positions(slow.duration / 2) == pytest.approx({"a1": 0.05})
