"""Between its first goal and the cycle in which it gets torque, an axis belongs to who told it something last, too."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from motorbus.errors import Interrupted
from motorbus.session.robot import AsyncRobot, Robot
from tests.motion.loop.test_rounds import RATE, cycles, looping
from tests.support.machines import listened, machine, said

TOLD = ["stop", "disable_torque", "hold", "estop"]
NAMES = ["a1", "c1"]


def tell(robot: Any, name: str, how: str) -> Any:
    """Tell an axis something from elsewhere; `estop` is for all and is taken off again."""
    if how != "estop":
        return getattr(robot[name], how)()
    robot.estop()
    return robot.reset()


def can(robot: Any, name: str, how: str) -> bool:
    """KST servos have no torque switch."""
    return how == "estop" or hasattr(robot[name], how)


@pytest.mark.parametrize("how", TOLD)
@pytest.mark.parametrize("name", NAMES)
def test_who_was_told_something_after_its_first_goal_is_not_begun(how: str, name: str) -> None:
    with looping(arm="1-2", can="0x21-0x22") as (robot, loop, sims):
        cycles(loop, 2)
        if not can(robot, name, how):
            assert name == "c1"
            return
        loop.goal[name] = 0.5
        tell(robot, name, how)
        listened(sims)
        with pytest.raises(Interrupted, match=f"{name}: stopped from elsewhere"):
            next(loop)
        assert said(sims) == []  # nothing at all has left
        assert name not in loop.goal
        before = cycles(loop, 1).position
        after = cycles(loop, 60).position
        assert after == pytest.approx(before, abs=0.01)
        assert loop.statistics.begun == 0
        loop.goal[name] = 0.2  # a new goal takes it back
        assert cycles(loop, 90).position[name] == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize("how", TOLD)
@pytest.mark.parametrize("name", NAMES)
def test_it_is_the_same_on_an_event_loop(how: str, name: str) -> None:
    async def main() -> None:
        with machine(arm="1-2", can="0x21-0x22") as (made, _):
            async with AsyncRobot.of(made) as robot, robot.loop(RATE) as loop:
                before = (await anext(loop)).position
                if not can(robot, name, how):
                    return
                loop.goal[name] = 0.5
                told = tell(robot, name, how)
                if told is not None:
                    await told
                with pytest.raises(Interrupted, match=f"{name}: stopped from elsewhere"):
                    await anext(loop)
                for _ in range(40):
                    state = await anext(loop)
                assert state.position == pytest.approx(before, abs=0.01)
                assert loop.statistics.begun == 0

    asyncio.run(main())


def test_only_who_was_told_something_is_released() -> None:
    with looping(arm="1-2") as (robot, loop, _):
        loop.goal.update({"a1": 0.3, "a2": 0.3})
        robot["a1"].stop()
        with pytest.raises(Interrupted, match="^a1: stopped"):
            next(loop)
        assert dict(loop.goal) == {"a2": 0.3}
        assert cycles(loop, 90).position == pytest.approx({"a1": 0.0, "a2": 0.3}, abs=0.02)


def test_a_stop_of_others_takes_nothing_away() -> None:
    with looping(arm="1-2") as (robot, loop, _):
        loop.goal["a1"] = 0.3
        robot["a2"].disable_torque()
        assert cycles(loop, 90).position["a1"] == pytest.approx(0.3, abs=0.02)


def test_a_goal_that_is_set_after_the_stop_counts() -> None:
    with looping(arm="1") as (robot, loop, _):
        loop.goal["a1"] = -0.5
        robot["a1"].stop()
        loop.goal["a1"] = 0.3
        assert cycles(loop, 90).position["a1"] == pytest.approx(0.3, abs=0.02)


def test_who_waits_for_its_torque_on_an_event_loop_can_be_stopped() -> None:
    """The other bus is slow to begin, and meanwhile somebody lets an axis go that is still to get its torque."""

    async def main(turns: int) -> None:
        with machine(arm="1-2", exit="leave") as (made, sims):
            async with AsyncRobot.of(made) as robot, robot.loop(RATE) as loop:
                await anext(loop)
                loop.goal["a1"] = 0.5
                cycle = asyncio.ensure_future(anext(loop))
                for _ in range(turns):
                    await asyncio.sleep(0)
                await robot["a1"].disable_torque()
                try:
                    await cycle
                    await anext(loop)
                except Interrupted:
                    pass
                assert sims["arm"][1].memory["torque_enable"] == 0

    for turns in range(0, 30, 3):
        asyncio.run(main(turns))


def test_a_movement_from_elsewhere_comes_before_a_goal_that_waits() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot, robot.loop(RATE) as loop:
        loop.goal["a1"] = -0.5
        robot["a1"].move(0.4)
        with pytest.raises(Interrupted, match="a1: stopped from elsewhere"):
            next(loop)
        assert cycles(loop, 30).position["a1"] == pytest.approx(0.4, abs=0.02)
