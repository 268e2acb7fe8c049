"""Routes: at each waypoint at its time, no jump that the kind forbids, and never outside what two waypoints enclose."""

from __future__ import annotations

from itertools import accumulate, pairwise
from math import inf, isclose, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.trajectory import Interpolation, Waypoint, interpolated
from motorbus.motion.trajectory.waypoints import joined

KINDS: tuple[Interpolation, ...] = ("linear", "cubic", "minimum_jerk")
places = st.floats(-100, 100)
stops = st.lists(st.tuples(st.floats(0.01, 10), places, places), min_size=1, max_size=8)


def waypoints(first: tuple[float, float], following: list[tuple[float, float, float]]) -> list[Waypoint]:
    times = accumulate(gap for gap, _, _ in following)
    ends = [
        Waypoint({"lift": lift, "turn": turn}, at)
        for at, (_, lift, turn) in zip(times, following, strict=True)
    ]
    return [Waypoint({"lift": first[0], "turn": first[1]}), *ends]


@given(st.sampled_from(KINDS), st.tuples(places, places), stops)
def test_it_is_at_each_waypoint_at_its_time_and_between_them_in_between(
    kind: Interpolation, first: tuple[float, float], following: list[tuple[float, float, float]]
) -> None:
    given_ = waypoints(first, following)
    route = interpolated(given_, kind)
    for at, waypoint in zip(route.times, given_, strict=True):
        assert route.positions(at) == waypoint.positions
    for number, (begin, end) in enumerate(pairwise(route.times)):
        for name in ("lift", "turn"):
            low, high = sorted(point.positions[name] for point in given_[number : number + 2])
            for index in range(101):
                place = route.positions(begin + (end - begin) * index / 100)[name]
                assert low - 1e-9 <= place <= high + 1e-9


@given(st.sampled_from(["cubic", "spline", "minimum_jerk"]), st.tuples(places, places), stops)
def test_velocity_begins_and_ends_with_nothing_and_never_jumps(
    kind: Interpolation, first: tuple[float, float], following: list[tuple[float, float, float]]
) -> None:
    route = interpolated(waypoints(first, following), kind)
    assert route.velocities(0.0) == pytest.approx({"lift": 0.0, "turn": 0.0})
    assert route.velocities(route.duration) == {"lift": 0.0, "turn": 0.0}
    for name, profiles in route.profiles.items():
        fastest = max(profile.peak for profile in profiles)
        for before, after in pairwise(profiles):
            ends, begins = before.velocity(before.duration), after.velocity(0.0)
            assert isclose(ends, begins, rel_tol=1e-9, abs_tol=1e-9 * (1 + fastest)), name


@given(st.tuples(places, places), stops)
def test_positions_are_the_sum_of_velocities_and_those_of_accelerations(
    first: tuple[float, float], following: list[tuple[float, float, float]]
) -> None:
    route = interpolated(waypoints(first, following), "cubic")
    for begin, end in pairwise(route.times):
        width = (end - begin) / 500
        middles = [begin + (index + 0.5) * width for index in range(500)]
        way = sum(route.velocities(at)["lift"] for at in middles) * width
        gone = route.positions(end)["lift"] - route.positions(begin)["lift"]
        assert isclose(way, gone, rel_tol=1e-4, abs_tol=1e-6)
        gain = sum(route.accelerations(at)["lift"] for at in middles) * width
        gained = route.velocities(end)["lift"] - route.velocities(begin)["lift"]
        assert isclose(gain, gained, rel_tol=1e-6, abs_tol=1e-6 * (1 + abs(way) / (end - begin)))


def test_a_cubic_passes_a_waypoint_on_the_way_and_rests_where_it_turns() -> None:
    lift = [Waypoint({"lift": place}, at) for at, place in enumerate((0.0, 1.0, 2.0, 1.0))]
    route = interpolated(lift)
    assert route.velocities(1.0)["lift"] == pytest.approx(1.0)
    assert route.velocities(2.0)["lift"] == 0.0


def test_a_cubic_hurries_no_more_than_three_times_the_slower_side() -> None:
    lift = [Waypoint({"lift": 0.0}), Waypoint({"lift": 0.1}, 1.0), Waypoint({"lift": 50.0}, 2.0)]
    assert 0 < interpolated(lift).velocities(1.0)["lift"] <= 0.3


def test_linear_jumps_at_a_waypoint() -> None:
    lift = [Waypoint({"lift": 0.0}), Waypoint({"lift": 1.0}, 1.0), Waypoint({"lift": -1.0}, 2.0)]
    route = interpolated(lift, "linear")
    assert [route.velocities(at)["lift"] for at in (0.0, 0.5, 1.0, 1.5, 2.0)] == [1.0, 1.0, -2.0, -2.0, 0.0]
    assert route.accelerations(0.5) == {"lift": 0.0}


def test_minimum_jerk_rests_at_each_waypoint() -> None:
    lift = [Waypoint({"lift": float(at)}, at or None) for at in range(4)]
    route = interpolated(lift, "minimum_jerk")
    assert [route.velocities(at)["lift"] for at in (1.0, 2.0)] == pytest.approx([0.0, 0.0])
    assert route.velocities(1.5)["lift"] == pytest.approx(1.875)


def test_a_speed_is_the_mean_one_of_the_axis_with_the_farthest_way() -> None:
    route = interpolated(
        [
            Waypoint({"lift": 0.0, "turn": 1.0}),
            Waypoint({"lift": 3.0, "turn": -1.0}, speed=1.5),
            Waypoint({"lift": 3.0, "turn": -1.0}, at=5.0),
            Waypoint({"lift": 2.9, "turn": -2.0}, speed=0.25),
        ]
    )
    assert route.times == (0.0, 2.0, 5.0, 9.0)
    assert route.positions(3.3) == {"lift": 3.0, "turn": -1.0}


def test_before_and_after_it_stands() -> None:
    route = interpolated([Waypoint({"lift": 0.0}), Waypoint({"lift": 1.0}, 1.0)], "linear")
    assert [route.positions(at)["lift"] for at in (-1.0, 2.0)] == [0.0, 1.0]
    assert [route.velocities(at)["lift"] for at in (-1.0, 1.0, 2.0)] == [0.0, 0.0, 0.0]


HERE = Waypoint({"lift": 0.0})


@pytest.mark.parametrize(
    ("given_", "says"),
    [
        ([], "0 waypoints are no way"),
        ([HERE], "1 waypoints are no way"),
        ([HERE, Waypoint({"lift": 1.0})], "waypoint 1: it has no time, or two"),
        ([HERE, Waypoint({"lift": 1.0}, 1.0, 1.0)], "waypoint 1: it has no time, or two"),
        ([HERE, Waypoint({"lift": 1.0}, 0.0)], "waypoint 1: it is at 0 s, not after"),
        ([HERE, Waypoint({"lift": 1.0}, nan)], "waypoint 1: it is at nan s"),
        ([HERE, Waypoint({"lift": 1.0}, inf)], "waypoint 1: it is at inf s"),
        ([HERE, Waypoint({"lift": 1.0}, 2.0), Waypoint({"lift": 1.0}, 1.0)], "waypoint 2: it is at 1 s"),
        ([HERE, Waypoint({"lift": 1.0}, speed=0.0)], "waypoint 1: its speed is 0.0"),
        ([HERE, Waypoint({"lift": 1.0}, speed=nan)], "waypoint 1: its speed is nan"),
        ([HERE, Waypoint({"lift": 0.0}, speed=1.0)], "waypoint 1: no axis moves"),
        ([HERE, Waypoint({"turn": 0.0}, 1.0)], "waypoint 1: it and the first differ in lift, turn"),
        ([Waypoint({}), Waypoint({}, 1.0)], "waypoint 0: it names no axis"),
        ([HERE, Waypoint({"lift": nan}, 1.0)], "waypoint 1: lift is at nan"),
        ([HERE, Waypoint({"lift": 1e9}, 1.0)], "waypoint 1: lift is at 1000000000.0"),
        ([Waypoint({"lift": 0.0}, 1.0), Waypoint({"lift": 1.0}, 2.0)], "waypoint 0: it is the beginning"),
        (
            [Waypoint({"lift": 0.0}, speed=1.0), Waypoint({"lift": 1.0}, 2.0)],
            "waypoint 0: it is the beginning",
        ),
    ],
)
def test_what_is_no_route_is_refused(given_: list[Waypoint], says: str) -> None:
    with pytest.raises(RequestError) as refused:
        interpolated(given_)
    assert refused.value.summary.startswith(says)
    assert refused.value.expected


def test_a_spline_meets_a_constant_acceleration_exactly_and_turns_back_between_rows() -> None:
    times = [0.0, 0.1, 0.25, 0.3, 0.45, 0.6]
    tossed = joined(times, {"lift": [at * (0.5 - at) for at in times]})
    for at in (0.22, 0.251, 0.28, 0.31):
        assert tossed.positions(at) == pytest.approx({"lift": at * (0.5 - at)})
        assert tossed.accelerations(at) == pytest.approx({"lift": -2.0})
    assert [*tossed.profiles["lift"]][1].goal == tossed.positions(0.25)["lift"]


def test_a_spline_rests_until_the_row_at_which_a_movement_begins() -> None:
    times = [0.1 * number for number in range(8)]
    begun = joined(times, {"lift": [max(0.0, at - 0.3) ** 2 for at in times]})
    assert begun.positions(0.26)["lift"] == pytest.approx(0.0, abs=1e-15)
    assert begun.positions(0.44)["lift"] == pytest.approx(0.14**2)


def test_a_kind_is_one_of_four() -> None:
    kind: Any = "quintic"
    with pytest.raises(RequestError, match="'quintic' is no kind") as refused:
        interpolated([HERE, HERE], kind)
    assert refused.value.expected == "one of linear, cubic, spline, minimum_jerk"
