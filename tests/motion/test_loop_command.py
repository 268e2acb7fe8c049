"""An axis belongs to who told it something last: a loop, a movement, another loop, or whoever has let it go."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from math import radians
from typing import Any

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.errors import Interrupted, MotorbusError
from motorbus.link.base import Side
from motorbus.motion.capabilities import disable_torque
from motorbus.motion.loop.faces import AsyncLoop
from motorbus.session.robot import AsyncRobot, Robot
from tests.motion.loop.test_rounds import RATE, cycles, looping
from tests.support.machines import Heard, machine

ARM = "1-3"


# -- in the middle of the beginning ------------------------------------------------------------------------------------


class Beginning(Heard):
    """A wire that does something as soon as its host has sent this frame of those that follow the reading."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number
        self.reached = asyncio.Event()

    def carry(self, sender: Side, data: Any, at: float) -> Any:
        found = super().carry(sender, data, at)
        if len(self.sent) >= self.number:
            self.reached.set()
        return found


async def interfered(number: int, act: Callable[[AsyncRobot], Awaitable[object]]) -> Any:
    """Somebody acts when the first cycle with goals has sent so many frames; the robot then, or None if it has not."""
    with machine(arm=ARM, exit="leave") as (made, sims):
        async with AsyncRobot.of(made) as robot, robot.loop(RATE) as loop:
            await anext(loop)
            sims["arm"].line = line = Beginning(number)
            led = asyncio.create_task(_leads(loop))
            waits = asyncio.create_task(line.reached.wait())
            await asyncio.wait((led, waits), return_when=asyncio.FIRST_COMPLETED)
            if led.done():
                waits.cancel()
                await led
                return None
            await act(robot)
            told = await _error(led)
            if told is None:  # its last goals had left already, and the next ones do not
                told = await _error(anext(loop))
            robot.buses["arm"].link.advance(0.1)  # type: ignore[attr-defined]
            memories = [sims["arm"][node].memory for node in (1, 2, 3)]
            torque = [bool(memory["torque_enable"]) for memory in memories]
            still = [abs(sims["arm"][node].raw_position - 2048) < 3 for node in (1, 2, 3)]
            return told, torque, [axis.engaged for axis in robot.axes.values()], still


async def _error(work: Awaitable[object]) -> MotorbusError | None:
    try:
        await work
    except MotorbusError as error:
        return error
    return None


async def _leads(loop: AsyncLoop) -> None:
    loop.goal.update(dict.fromkeys(loop.axes, 0.3))
    await anext(loop)


async def _all_frames(act: Callable[[AsyncRobot], Awaitable[object]]) -> list[Any]:
    found: list[Any] = []
    for number in range(1, 100):
        told = await interfered(number, act)
        if told is None:
            return found
        found.append(told)
    raise AssertionError("it never ended")


def test_who_is_let_go_in_the_middle_of_the_beginning_is_limp_then_at_every_frame() -> None:
    found = asyncio.run(_all_frames(lambda robot: robot["a2"].disable_torque()))
    assert len(found) > 15
    for error, torque, engaged, still in found:
        assert isinstance(error, Interrupted)
        assert "a2: stopped from elsewhere" in str(error)
        assert not torque[1]
        assert not engaged[1]
        assert all(still)


async def _estop(robot: AsyncRobot) -> None:
    robot.estop()
    robot.reset()


def test_after_an_emergency_stop_in_the_middle_of_the_beginning_nobody_has_torque() -> None:
    found = asyncio.run(_all_frames(_estop))
    assert len(found) > 15
    for error, torque, _, still in found:
        assert isinstance(error, Interrupted)
        assert not any(torque)
        assert all(still)


def test_who_is_stopped_in_the_middle_of_the_beginning_is_led_by_nobody() -> None:
    found = asyncio.run(_all_frames(lambda robot: robot["a3"].stop()))
    assert all(isinstance(error, Interrupted) for error, *_ in found)
    assert all(all(still) for *_, still in found)


def test_who_was_given_torque_before_letting_go_was_over_counts_as_given_torque() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis: Any = robot["a1"]
        bus: Any = robot.buses["arm"]
        lets_go = disable_torque(axis)
        step = lets_go.send(None)
        axis.departs()  # a loop begins meanwhile
        with suppress(StopIteration):
            while True:
                step = lets_go.send(bus.run(step))
        assert axis.engaged
        axis.disable_torque()
        assert not axis.engaged


# -- movements and other loops -----------------------------------------------------------------------------------------


async def _while_led(act: Callable[[AsyncRobot], Awaitable[object]], goal: float = 0.0) -> Any:
    """A loop leads a1 to a goal; somebody acts; what became of the loop, of that, and where a1 is then."""
    with machine(arm="1-2") as (made, _):
        async with AsyncRobot.of(made) as robot:
            begun = asyncio.Event()

            async def leads() -> None:
                async with robot.loop(RATE) as loop:
                    async for state in loop:
                        loop.goal["a1"] = goal
                        if state.number == 50:
                            begun.set()
                        if state.number >= 500:
                            return

            led = asyncio.create_task(leads())
            await begun.wait()
            acted = await act(robot)
            (told,) = await asyncio.gather(led, return_exceptions=True)
            return told, acted, await robot["a1"].position()


def test_a_movement_takes_an_axis_from_a_loop() -> None:
    told, _, stands = asyncio.run(_while_led(lambda robot: robot["a1"].move(-0.4)))
    assert isinstance(told, Interrupted)
    assert "a1: stopped from elsewhere" in str(told)
    assert stands == pytest.approx(-0.4, abs=0.02)


def test_another_loop_takes_an_axis_from_a_loop() -> None:
    async def leads(robot: AsyncRobot) -> None:
        async with robot.loop(RATE) as loop:
            async for state in loop:
                loop.goal["a1"] = -0.4
                if state.number == 150:
                    return

    told, _, stands = asyncio.run(_while_led(leads))
    assert isinstance(told, Interrupted)
    assert stands == pytest.approx(-0.4, abs=0.02)


def test_a_loop_takes_an_axis_from_a_movement() -> None:
    async def main() -> None:
        with machine(arm="1-2") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                moves = asyncio.create_task(robot["a1"].move(1.0, duration=4.0))
                while sims["arm"][1].raw_position < 2048 + 50:
                    await asyncio.sleep(0)
                async with robot.loop(RATE) as loop:
                    async for state in loop:
                        loop.goal["a1"] = 0.0
                        if state.number == 150:
                            break
                with pytest.raises(Interrupted, match="a1: the movement was ended by another order"):
                    await moves
                assert await robot["a1"].position() == pytest.approx(0.0, abs=0.02)

    asyncio.run(main())


def test_a_reading_takes_nothing_from_anybody() -> None:
    told, _, stands = asyncio.run(_while_led(lambda robot: robot.positions(), goal=0.3))
    assert told is None
    assert stands == pytest.approx(0.3, abs=0.02)


def test_who_was_taken_is_taken_back_by_the_next_goal_and_the_others_went_on() -> None:
    with looping(arm="1-2") as (robot, loop, _):
        loop.goal.update({"a1": 0.8, "a2": 0.8})
        cycles(loop, 30)
        robot["a1"].move(0.1)
        with pytest.raises(Interrupted, match="a1: stopped from elsewhere"):
            next(loop)
        assert dict(loop.goal) == {"a2": 0.8}
        loop.goal["a1"] = 0.5
        assert cycles(loop, 150).position == pytest.approx({"a1": 0.5, "a2": 0.8}, abs=0.02)


def test_a_stop_of_a_node_on_can_is_seen_although_it_is_no_stop_of_the_bus() -> None:
    with looping(can="0x21-0x22") as (robot, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.6))
        cycles(loop, 20)
        robot["c1"].stop()
        sims["can"].line = line = Heard()
        with pytest.raises(Interrupted, match="c1: stopped from elsewhere"):
            next(loop)
        assert not line.sent
        cycles(loop, 1)
        written = [
            data.id - 0x600 for data in line.sent if isinstance(data, CanFrame) and data.data[0] == 0x22
        ]
        assert written == [0x22]


# -- a beginning that fails, and one while others are under way --------------------------------------------------------


def test_who_could_not_begin_has_no_goal_any_more() -> None:
    with looping(arm="1-3") as (robot, loop, sims):
        loop.goal["a3"] = 0.1
        cycles(loop, 2)
        sims["arm"][2].unplug()
        loop.goal.update({"a1": 0.2, "a2": 0.2})
        with pytest.raises(MotorbusError, match="node 2"):
            next(loop)
        sims["arm"][2].plug()
        assert dict(loop.goal) == {"a3": 0.1}
        sims["arm"].line = line = Heard()
        cycles(loop, 3)
        assert all(data[4] in (0x82, 0x83) for data in line.sent if isinstance(data, bytes))
        assert not robot["a2"].under_way
        loop.goal["a2"] = 0.2
        assert cycles(loop, 100).position["a2"] == pytest.approx(0.2, abs=0.02)


def test_who_had_to_stand_while_others_began_goes_on_from_rest() -> None:
    with looping(arm="1-6") as (_, loop, sims):
        loop.goal["a1"] = 2.0
        cycles(loop, 60)
        one = loop._rounds.places["a1"]
        before: Any = one.sent
        loop.goal.update(dict.fromkeys(("a2", "a3", "a4", "a5", "a6"), 0.1))
        sims["arm"].line = Slow(0.002)
        cycles(loop, 1)
        here: Any = one.sent
        way = here - before
        assert 0 < way < radians(90) / RATE / 10


class Slow(Heard):
    """Whatever the devices say comes so much later (s)."""

    def __init__(self, by: float) -> None:
        super().__init__()
        self.by = by

    def carry(self, sender: Side, data: Any, at: float) -> Any:
        late = at if sender is Side.HOST else at + self.by
        return super().carry(sender, data, late)


def test_a_body_that_was_late_is_booked_although_axes_begin_then() -> None:
    with looping(arm="1") as (robot, loop, _):
        cycles(loop, 5)
        robot.buses["arm"].link.advance(0.035)  # type: ignore[attr-defined]
        loop.goal["a1"] = 0.1
        cycles(loop, 1)
        told = loop.statistics
        assert (told.overruns, told.skipped, told.begun) == (1, 2, 1)


def test_who_is_held_back_is_told_when_the_others_have_been_told_their_goals() -> None:
    with looping(arm="1-2", exit="leave", axes={"a2": {"max_step": "10 deg"}}) as (_, loop, sims):
        sims["arm"][2].blocked = (2000, 2100)
        loop.goal.update({"a1": 1.5, "a2": 1.0})
        refused, last, steps = 0, 0.0, []
        for _ in range(200):
            loop.goal.update({"a1": 1.5, "a2": 1.0})
            with suppress(MotorbusError):
                next(loop)
                refused -= 1
            refused += 1
            here: Any = loop._rounds.places["a1"].sent
            steps.append(here - last)
            last = here
        assert refused > 50
        assert last == pytest.approx(1.5)  # it went all its way, and never leapt
        assert max(steps) <= radians(90) / RATE * 1.001
        assert sims["arm"][1].memory["goal_position"] == pytest.approx(2048 + 1.5 / 0.001534, abs=2)
        loop.goal["a2"] = 0.0
