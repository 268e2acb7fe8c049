"""Small goals on a fixed grid: when they leave, how fast, and what is seen on the way."""

from __future__ import annotations

import asyncio
from math import nan, pi
from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, LimitExceeded, NoReply, RequestError, Stalled
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.moving.stream import SETTLE, Fate, Grid, grains, rate_for
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import machine
from tests.support.noisy_line import NoisyLine
from tests.support.world import set_rate


def train(robot: Robot, bus: str) -> Any:
    axes = [axis for axis in robot.axes.values() if axis.spec.bus == bus]
    wanted = axes[0].able.stream([axis.device for axis in axes], rate=robot.buses[bus].rate)
    return robot[axes[0].name].bus.run(wanted)


# -- the grid ----------------------------------------------------------------------------------------------------------


def test_the_last_goal_leaves_one_period_before_the_end_and_no_slot_is_shorter_than_asked() -> None:
    assert Grid.over(1.0, 100.0) == (0.01, 99)
    grid = Grid.over(0.887, 100.0)
    assert grid.last == 87
    assert grid.period == pytest.approx(0.887 / 88)
    assert grid.period >= 0.01
    assert Grid.over(0.003, 100.0) == (0.003, 0)
    assert Grid.over(0.0, 100.0) == (0.01, 0)


def test_slots_that_have_gone_by_are_skipped_but_never_the_last_one() -> None:
    grid = Grid(0.01, 99)
    assert grid.after(0, 0.004) == 1
    assert grid.after(0, 0.01) == 1
    assert grid.after(0, 0.0101) == 2
    assert grid.after(0, 0.05) == 5
    assert grid.after(97, 5.0) == 99


# -- rate and resolution -----------------------------------------------------------------------------------------------


def test_axes_are_led_at_100_hz_or_half_of_what_the_wire_carries() -> None:
    with machine(arm="1-6", can="0x25,0x26") as (made, _), Robot.of(made) as robot:
        arm, angles = train(robot, "arm"), dict.fromkeys(range(1, 7), pi)
        assert rate_for(robot.buses["arm"], arm, angles) == 100.0
        assert rate_for(robot.buses["arm"], arm, angles, 333.0) == 333.0
        for rate in (0.0, -1.0, 3.9, 5000.0, nan):
            with pytest.raises(RequestError, match="Hz is not possible") as told:
                rate_for(robot.buses["arm"], arm, angles, rate)
            assert "at most" in str(told.value)


def test_a_slow_wire_leads_slower() -> None:
    with machine(arm="1-6") as (made, _), Robot.of(made) as robot:
        arm, bus = train(robot, "arm"), robot.buses["arm"]
        set_rate(bus, 9600)
        # 26 bytes of goals, 8 + 6 that ask, 6 * 8 that answer, 10 bits each, and half of that rate
        angles = dict.fromkeys(range(1, 7), pi)
        assert rate_for(bus, arm, angles) == pytest.approx(0.5 * 9600 / 10 / 88)
        set_rate(bus, 4800)  # a goal must not be farther ahead than 0.25 s
        assert rate_for(bus, arm, angles) == 4.0
        set_rate(bus, 2400)
        with pytest.raises(RequestError, match="4 Hz is not possible"):
            rate_for(bus, arm, angles)
        set_rate(bus, 1_000_000)


def test_the_smallest_step_is_what_the_goals_themselves_say() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        assert grains(train(robot, "arm"), {1: pi}) == pytest.approx({1: 2 * pi / 4096})
        can = train(robot, "can")
        assert grains(can, {0x25: 0.0}) == pytest.approx({0x25: pi / 1800})
        edge = next(angle / 10 for angle in range(200) if _beyond(can, angle / 10 + 0.1))
        assert grains(can, {0x25: edge}) == pytest.approx({0x25: pi / 1800})  # also where one way is closed


def _beyond(train: Any, angle: float) -> bool:
    try:
        train.goals({0x25: angle})
    except LimitExceeded:
        return True
    return False


# -- on the way --------------------------------------------------------------------------------------------------------


def test_readings_that_are_lost_now_and_then_do_no_harm_and_are_counted() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = NoisyLine(5, loss=0.02, corrupt=0.02, toward=Side.HOST)
        moved = robot.move({"a1": 0.5, "a2": -0.5, "a3": 0.2}, duration=2.0)
        sims["arm"].line = NoisyLine(5)
        assert moved.cycles["arm"].lost > 0
        assert robot.positions() == pytest.approx({"a1": 0.5, "a2": -0.5, "a3": 0.2}, abs=0.004)


def test_a_line_that_is_late_costs_slots_and_no_time() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = NoisyLine(5, late=0.05, late_by=(0.02, 0.03))
        before = robot.buses["arm"].link.now()
        moved = robot.move({"a1": 0.5}, duration=2.0)
        sims["arm"].line = NoisyLine(5)
        cycles = moved.cycles["arm"]
        assert cycles.skipped > 3
        assert cycles.done + cycles.skipped == 200
        assert moved.duration == 2.0
        assert robot.buses["arm"].link.now() - before < 2.5
        assert moved.tracks["a1"].error < 0.02


class Without(PerfectLine):
    """A line that loses one packet of goals, by its number from 1 on."""

    def __init__(self, number: int) -> None:
        self.seen = 0
        self._number = number

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes) and data[4] == 0x83 and data[5] == 42:
            self.seen += 1
            if self.seen == self._number:
                return []
        return super().carry(sender, data, at)


@pytest.mark.parametrize("number", [1, 60, 99, 100])
def test_a_goal_that_is_lost_is_made_good_by_the_next_one_the_last_one_too(number: int) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = line = Without(number)
        moved = robot.move({"a1": 0.5}, duration=1.0)
        robot.buses["arm"].link.advance(0.1)  # type: ignore[attr-defined]
        assert line.seen >= 100
        assert moved.axes["a1"].present == pytest.approx(0.5, abs=0.005)
        assert sims["arm"][1].memory["goal_position"] == sims["arm"][1].raw_position == 2048 + 326


def test_one_step_farther_than_the_axis_may_be_from_its_goal_ends_the_movement() -> None:
    with machine(arm="1", axes={"a1": {"max_step": "5 deg"}}) as (made, sims), Robot.of(made) as robot:
        assert robot.move({"a1": 0.8}).axes["a1"].present == pytest.approx(0.8, abs=0.002)
        sims["arm"][1].blocked = (2048 + 400, 2048 + 600)
        with pytest.raises(Stalled, match=r"a1 does not follow.*\n  expected: within 5\.0 deg"):
            robot.move({"a1": 0.0})


def test_a_part_that_fails_is_told_to_the_others_once() -> None:
    fate = Fate()
    fate.check()
    fate.fail(NoReply("the first"))
    fate.fail(NoReply("the second"))
    with pytest.raises(Interrupted, match="another part of it failed") as told:
        fate.check()
    assert "the first" in str(told.value)


# -- after the end -----------------------------------------------------------------------------------------------------


class Last(PerfectLine):
    """A line on which it is noted when (s) the host was last heard."""

    at = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        self.at = at if sender is Side.HOST else self.at
        return super().carry(sender, data, at)


def test_an_axis_has_a_second_to_come_to_its_place_and_no_more() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (2000, 2048 + 240)
        sims["arm"].line = line = Last()
        with pytest.raises(Stalled, match="a1 is not in position"):
            robot.move({"a1": 0.4}, duration=2.0)
        assert line.at == pytest.approx(2.0 + SETTLE, abs=0.05)


@pytest.mark.parametrize(("whose", "later"), [("a1", 0.75), ("lift", 0.3)])
def test_while_an_axis_comes_to_its_place_a_stop_of_it_or_of_another_ends_that(
    whose: str, later: float
) -> None:
    async def both() -> None:
        with machine(arm="1", lift=True, exit="leave") as (made, sims):
            events: list[Any] = []
            async with AsyncRobot.of(made, report=events.append) as robot:
                robot["lift"].declare(0.0)
                sims["arm"][1].blocked = (2000, 2048 + 240)
                sims["arm"].line = line = Last()
                movement = asyncio.create_task(robot.move({"a1": 0.4, "lift": 0.02}, duration=4.0))
                while not any(one.done >= 3700 for one in events if isinstance(one, Progress)):
                    await asyncio.sleep(0)
                end = robot.buses["arm"].link.now() + later
                while robot.buses["arm"].link.now() < end:
                    await asyncio.sleep(0)
                await robot[whose].stop()
                with pytest.raises(Interrupted, match=f"{whose}: the movement was ended by another order"):
                    await movement
                assert line.at - end < 0.1

    asyncio.run(asyncio.wait_for(both(), 60))
