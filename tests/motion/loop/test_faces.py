"""The faces of a loop, blocking and awaited, of one source; and verbs that are made of one."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.body import Body
from motorbus.motion.loop.faces import AsyncLoop, Errand, Loop, LoopFace, looped
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.parallel import Led, Parallel
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import Heard, machine


def lead(loop: Any, state: LoopState) -> None:
    """As the first page shows it."""
    loop.goal["a2"] = 0.5 * state.position["a1"]
    loop.goal["a1"] = 0.4


def test_the_example_of_the_first_page() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot, robot.loop(rate=200) as loop:
        assert isinstance(loop, Loop)
        for state in loop:
            lead(loop, state)
            if state.number == 200:
                break
        assert state.position["a1"] == pytest.approx(0.4, abs=0.01)
        assert state.position["a2"] == pytest.approx(0.2, abs=0.01)
        assert loop.statistics.cycles == 201
        assert (loop.rate, loop.axes, loop.without) == (200, ("a1", "a2"), ())
        assert repr(state).startswith("<LoopState 200 at ")


def test_the_same_on_an_event_loop_is_the_same() -> None:
    blocking, awaited = [], []
    with machine(arm="1-2", can="0x21") as (made, _), Robot.of(made) as robot, robot.loop(rate=100) as loop:
        for state in loop:
            lead(loop, state)
            blocking.append((state.number, state.position))
            if state.number == 60:
                break

    async def main() -> None:
        with machine(arm="1-2", can="0x21") as (made, _):
            async with AsyncRobot.of(made) as robot, robot.loop(rate=100) as loop:
                assert isinstance(loop, AsyncLoop)
                async for state in loop:
                    lead(loop, state)
                    awaited.append((state.number, state.position))
                    if state.number == 60:
                        break
                assert loop.statistics.overruns == 0

    asyncio.run(main())
    assert len(blocking) == len(awaited) == 61
    for (number, position), (other, same) in zip(blocking, awaited, strict=True):
        assert number == other
        assert position == pytest.approx(same, abs=0.003)


def test_a_cancelled_task_brakes() -> None:
    async def main() -> Any:
        with machine(arm="1", exit="leave") as (made, _):
            async with AsyncRobot.of(made) as robot:

                async def moves() -> None:
                    async with robot.loop(rate=100) as loop:
                        async for state in loop:
                            loop.goal["a1"] = 2.0
                            if state.number == 60:
                                asyncio.current_task().cancel()  # type: ignore[union-attr]

                with pytest.raises(asyncio.CancelledError):
                    await asyncio.create_task(moves())
                return robot["a1"].under_way, await robot["a1"].position()

    moving, position = asyncio.run(main())
    assert not moving
    assert 0.8 < position < 1.5


def test_a_refused_goal_can_be_caught_outside_the_for_and_it_goes_on() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot, robot.loop(100) as loop:

        def leads() -> None:
            for _ in loop:
                loop.goal["a1"] = 9.0

        with pytest.raises(LimitExceeded):
            leads()
        assert not dict(loop.goal)
        assert next(loop).number == 1


def test_goals_are_a_mapping_that_only_takes_axes_of_the_loop() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot, robot.loop(100, "a1") as loop:
        assert (dict(loop.goal), len(loop.goal)) == ({}, 0)
        with pytest.raises(KeyError):
            loop.goal["a1"]
        loop.goal.update({"a1": 0.1})
        assert dict(loop.goal) == {"a1": 0.1}
        with pytest.raises(RequestError, match="a2 is not in this loop"):
            loop.goal.update({"a1": 0.2, "a2": 0.1})
        assert dict(loop.goal) == {"a1": 0.1}
        assert loop.allows("a1", 2.6)
        assert not loop.allows("a1", 2.7)


# -- verbs that are made of a loop -------------------------------------------------------------------------------


class Counting:
    """Ends after some cycles; sees whether something was done before."""

    def __init__(self, count: int, interrupts: bool) -> None:
        self.left = count
        self.interrupts = interrupts

    def step(self, loop: LoopFace, state: LoopState) -> bool:
        self.left -= 1
        if self.interrupts and not self.left:
            raise KeyboardInterrupt
        return self.left > 0

    def result(self, loop: LoopFace) -> int:
        return loop.statistics.cycles


def counted(body: Body, count: int, *, interrupts: bool = False, endless: bool = False) -> Errand[int]:
    """Count cycles."""

    async def asks() -> Any:
        return await body.axes["a1"].able.position(body.axes["a1"].device)

    return Errand(
        Counting(count, interrupts), 100, ("a1",), lambda: Parallel({"arm": asks()}, dict), endless=endless
    )


class Counter(Robot):
    """A robot with one more verb."""

    counted = looped(counted)


class AsyncCounter(AsyncRobot):
    """The same, awaited."""

    counted = looped(counted)


def test_a_verb_is_blocking_on_one_and_awaited_on_the_other() -> None:
    with machine(arm="1") as (made, _), Counter.of(made) as robot:
        assert robot.counted(7) == 7
        assert Counter.counted.__doc__ == robot.counted.__doc__ == "Count cycles."

    async def main() -> int:
        with machine(arm="1") as (made, _):
            async with AsyncCounter.of(made) as robot:
                return await robot.counted(5)

    assert asyncio.run(main()) == 5


def test_ctrl_c_ends_what_has_no_other_end_and_is_raised_otherwise() -> None:
    with machine(arm="1") as (made, _), Counter.of(made) as robot:
        assert isinstance(robot, Led)
        assert robot.counted(4, interrupts=True, endless=True) == 4
        with pytest.raises(KeyboardInterrupt):
            robot.counted(4, interrupts=True)


def test_a_loop_needs_an_open_machine() -> None:
    with machine(arm="1") as (made, _):
        with Robot.of(made) as robot:
            pass
        with pytest.raises(RequestError, match="the machine is closed"):
            robot.loop(100)
        with pytest.raises(RequestError, match="the machine is not open"):
            AsyncRobot.of(made).loop(100)


def test_a_loop_that_was_not_entered_says_so() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = line = Heard()
        loop = robot.loop(100)
        with pytest.raises(RequestError, match=r"(?s)was not entered.*enter the loop with `with`"):
            next(loop)
        with pytest.raises(RequestError, match="was not entered"):
            loop.goal["a1"] = 0.1
        assert not line.sent


def test_a_loop_that_was_left_moves_nothing_any_more_and_is_not_entered_again() -> None:
    with machine(arm="1", exit="leave") as (made, sims), Robot.of(made) as robot:
        with robot.loop(100) as loop:
            loop.goal["a1"] = 0.1
            next(loop)
        sims["arm"].line = line = Heard()
        for tries in (lambda: next(loop), lambda: loop.goal.update({"a1": 0.2}), loop.__enter__):
            with pytest.raises(RequestError, match=r"the loop was (left|entered before)"):
                tries()
        with pytest.raises(RequestError, match="the loop was left"):
            loop.goal["a1"] = 0.2
        assert not line.sent
        assert (loop.axes, loop.statistics.cycles) == (("a1",), 1)


def test_the_same_of_one_on_an_event_loop() -> None:
    async def main() -> None:
        with machine(arm="1", exit="leave") as (made, _):
            async with AsyncRobot.of(made) as robot:
                loop = robot.loop(100)
                with pytest.raises(RequestError, match="was not entered"):
                    await anext(loop)
                async with loop:
                    await anext(loop)
                with pytest.raises(RequestError, match="was left"):
                    await anext(loop)

    asyncio.run(main())
