"""With the policy `clamp` a goal goes as far as it may; that is counted, and told now and then."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf, nan, radians
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.clamping import Clamped
from motorbus.motion.loop.faces import Loop
from motorbus.session.robot import AsyncRobot, Robot
from tests.motion.loop.test_rounds import RATE, cycles
from tests.support.machines import machine

HIGH = radians(150)
STEP = radians(90) / RATE


@contextmanager
def clamping(*, direct: bool = False, **made: Any) -> Iterator[tuple[Loop, list[object], Any]]:
    """A loop that clamps, what it told, and its simulations."""
    told: list[object] = []
    with (
        machine(**made) as (found, sims),
        Robot.of(found, report=told.append) as robot,
        robot.loop(RATE, policy="clamp", direct=direct) as loop,
    ):
        yield loop, told, sims


def test_a_goal_beyond_the_limits_goes_to_the_limit_and_is_told() -> None:
    with clamping(arm="1-2") as (loop, told, _):
        loop.goal.update({"a1": 9.0, "a2": 0.2})
        state = cycles(loop, 260)
        assert state.position == pytest.approx({"a1": HIGH, "a2": 0.2}, abs=0.02)
        assert dict(loop.goal) == {"a1": HIGH, "a2": 0.2}
        assert told == [Clamped("a1", 9.0, HIGH, "limits")]
        assert loop.statistics.clamped == {"a1": 1, "a2": 0}
        assert "clamped: a1 1" in str(loop.statistics)


def test_of_many_only_the_first_and_one_in_half_a_second_is_told() -> None:
    with clamping(arm="1-2", can="0x21") as (loop, told, _):
        for number in range(int(RATE)):  # a second
            loop.goal.update({"a1": 9.0 + number, "c1": -3.0})
            next(loop)
        assert loop.statistics.clamped == {"a1": 100, "a2": 0, "c1": 100}
        names = [event.axis for event in told if isinstance(event, Clamped)]
        assert (names.count("a1"), names.count("c1"), len(told)) == (2, 2, 4)


@pytest.mark.parametrize("goal", [nan, inf, -inf])
@pytest.mark.parametrize("direct", [False, True])
def test_what_is_no_number_is_refused_all_the_same(goal: float, direct: bool) -> None:
    with clamping(arm="1", direct=direct) as (loop, told, _sims):
        loop.goal["a1"] = 0.0
        cycles(loop, 3)
        loop.goal["a1"] = goal
        with pytest.raises(LimitExceeded, match="its goal is"):
            next(loop)
        assert (told, loop.goal["a1"], loop.statistics.clamped) == ([], 0.0, {"a1": 0})
        assert cycles(loop, 5).position["a1"] == pytest.approx(0.0, abs=0.01)


def test_a_direct_goal_goes_as_far_as_its_axis_can_in_that_time() -> None:
    with clamping(arm="1", direct=True) as (loop, told, _):
        loop.goal["a1"] = 0.0
        cycles(loop, 3)
        loop.goal["a1"] = 0.5
        next(loop)
        assert loop.goal["a1"] == pytest.approx(STEP)
        (event,) = told
        assert isinstance(event, Clamped)
        assert (event.asked, event.reason) == (0.5, "velocity")
        assert event.given == pytest.approx(STEP)
        loop.goal["a1"] = STEP + 0.001
        cycles(loop, 40)
        assert loop.statistics.clamped == {"a1": 1}


def test_a_direct_goal_keeps_to_the_step_from_where_it_is_measured() -> None:
    careful = {"a1": {"max_step": "0.5 deg"}}
    with clamping(arm="1", direct=True, axes=careful) as (loop, told, _):
        loop.goal["a1"] = 0.0
        cycles(loop, 3)
        loop.goal["a1"] = 0.1
        next(loop)
        assert loop.goal["a1"] == pytest.approx(radians(0.5), abs=0.002)
        assert [event.reason for event in told if isinstance(event, Clamped)] == ["step"]


def test_what_is_allowed_is_left_alone() -> None:
    with clamping(arm="1", direct=True) as (loop, told, _):
        for number in range(50):
            loop.goal["a1"] = 0.9 * STEP * number
            next(loop)
        assert (told, loop.statistics.clamped) == ([], {"a1": 0})
        assert "clamped" not in str(loop.statistics)


def test_it_is_told_on_an_event_loop_too() -> None:
    async def main() -> list[object]:
        told: list[object] = []
        with machine(arm="1") as (made, _):
            async with (
                AsyncRobot.of(made, report=told.append) as robot,
                robot.loop(RATE, policy="clamp") as loop,
            ):
                loop.goal["a1"] = -9.0
                await anext(loop)
        return told

    assert asyncio.run(main()) == [Clamped("a1", -9.0, -HIGH, "limits")]


def test_as_a_rule_a_goal_is_refused() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        with robot.loop(RATE) as loop:
            loop.goal["a1"] = 9.0
            with pytest.raises(LimitExceeded):
                next(loop)
        with pytest.raises(RequestError, match="'bend' is no policy"):
            robot.loop(RATE, policy="bend")  # type: ignore[arg-type]
        with pytest.raises(RequestError, match="'bend' is no policy"):
            robot.follow({"a1": "a1"}, policy="bend")  # type: ignore[arg-type]
