"""Following: across buses and families, without a jump, and never after a leader that nobody hears."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from math import radians
from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.motion.follow import Ending, Followed
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import machine

STILL = 0.02


def test_a_follower_comes_after_its_leader_within_its_own_limits() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        move(robot, "a1", 1.0)
        found = robot.follow({"a1": "a2"}, seconds=2.0)
        assert isinstance(found, Followed)
        assert found.seconds == pytest.approx(2.0)
        assert found.held == {"a2": 0}
        assert abs(found.apart["a2"]) < STILL
        assert robot["a2"].position() == pytest.approx(1.0, abs=STILL)
        assert "a2 after a1: 2.0 s" in str(found)


def test_the_way_of_a_follower_has_no_jump() -> None:
    with machine(arm="1-2", can="0x21") as (made, sims), Robot.of(made) as robot:
        move(robot, "a1", 0.7)
        places: list[float] = []
        robot.follow({"a1": "c1"}, rate=100, until=lambda: watched(sims, places))
        steps = [abs(after - before) for before, after in pairwise(places)]
        assert max(steps) < radians(90) / 100 * 2.5
        assert robot["c1"].position() == pytest.approx(0.7, abs=STILL)


def watched(sims: Any, places: list[float]) -> bool:
    """Where the follower's target is, cycle by cycle."""
    raw = sims["can"][0x21].memory["goal_position"]
    places.append(radians(raw / 10))
    return len(places) > 200


def move(robot: Robot, name: str, to: float) -> None:
    """By the device's own verb."""
    axis = robot[name]
    axis.enable_torque()
    robot.buses[axis.spec.bus].run(axis.able.move(axis.device, axis.spec.to_device(to), velocity=1.5))  # type: ignore[attr-defined]


def test_leaders_are_let_go_and_followers_hold() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot.follow({"a1": "a2"}, seconds=0.2)
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [0, 1]


def test_what_the_loop_refuses_lets_nobody_go() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        with pytest.raises(RequestError, match="rate is 20000000"):
            robot.follow({"a1": "a2"}, rate=2e7, seconds=1.0)
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [1, 1]


def test_a_leader_that_nobody_hears_moves_nobody() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        move(robot, "a1", 0.5)
        count = [0]

        def over() -> bool:
            count[0] += 1
            if count[0] == 3:
                sims["arm"][1].unplug()
            if count[0] == 4:
                sims["arm"][1].plug()
            return count[0] > 150

        found = robot.follow({"a1": "a2"}, until=over)
        assert found.held["a2"] >= 1
        assert found.statistics.lost["a1"] == found.held["a2"]
        assert robot["a2"].position() == pytest.approx(0.5, abs=STILL)


def test_a_leader_beyond_the_follower_s_limits_leaves_it_where_it_may_be() -> None:
    with (
        machine(arm="1-2", axes={"a2": {"low": "-10 deg", "high": "10 deg"}}) as (made, _),
        Robot.of(made) as robot,
    ):
        move(robot, "a1", 0.5)
        found = robot.follow({"a1": "a2"}, seconds=0.5)
        assert found.held["a2"] == 51
        assert robot["a2"].position() == pytest.approx(0.0, abs=STILL)
        assert not robot["a2"].engaged


@pytest.mark.parametrize(
    ("pairs", "match"),
    [
        ({}, "nobody follows"),
        ({"a1": "a1"}, "leads or follows already"),
        ({"a1": "a2", "a2": "a3"}, "leads or follows already"),
        ({"a1": "a3", "a2": "a3"}, "leads or follows already"),
        ({"a1": "nose"}, "no open axis 'nose'"),
        ({"a1": "lift"}, "lift cannot be led in a loop"),
        ({"lift": "a1"}, "lift cannot be followed"),
        ({"a1": "slide"}, "one of them turns and the other is linear"),
    ],
)
def test_pairs_that_cannot_be_are_refused(pairs: dict[str, str], match: str) -> None:
    axes = {"a4": {"travel": "5 mm", "unit": "mm", "low": "0 mm", "high": "2 mm"} | LINEAR}
    with machine(arm="1-4", lift=True, axes=axes) as (made, _), Robot.of(made) as robot:
        wanted = {leader: {"slide": "a4"}.get(name, name) for leader, name in pairs.items()}
        with pytest.raises(RequestError, match=match):
            robot.follow(wanted, seconds=1.0)


LINEAR = {"max_velocity": "20 mm/s", "max_acceleration": "100 mm/s2"}


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_a_time_is_above_nothing(seconds: float) -> None:
    with (
        machine(arm="1-2") as (made, _),
        Robot.of(made) as robot,
        pytest.raises(RequestError, match="seconds is"),
    ):
        robot.follow({"a1": "a2"}, seconds=seconds)


def test_it_is_awaited_on_an_async_robot() -> None:
    async def main() -> Followed:
        with machine(arm="1-2") as (made, _):
            async with AsyncRobot.of(made) as robot:
                return await robot.follow({"a1": "a2"}, seconds=0.3)

    assert asyncio.run(main()).statistics.cycles == 31


def test_an_ending_is_by_time_or_by_somebody() -> None:
    one = Ending(100.0, 0.1, None)
    assert [one(number) for number in (5, 10, 14, 15)] == [False, False, False, True]
    assert one.seconds == pytest.approx(0.1)
    said = iter((False, True))
    assert [Ending(100.0, None, lambda: next(said))(number) for number in (0, 1)] == [False, True]
