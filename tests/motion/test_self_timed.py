"""A lift of a stepper controller that moves together with servos: real drivers in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, MotorbusError
from motorbus.families.stepper.execution.machine import Phase
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.robot import AsyncRobot, Robot
from motorbus.session import unfinished
from tests.support.machines import Recorded, asks, listen, machine, orders

RUN_ONCE = b"\xff\xaa\x03\x0c"
GOALS = {"a1": 1.0, "a2": -0.5, "lift": 0.1}
TURN = 5e-3  # m of the lift


class Bench:
    """A robot of a1, a2 and a lift at 0, its simulations, the simulated controller and its project 1 as it was."""

    def __init__(self, robot: Robot, sims: Any) -> None:
        self.robot, self.sims = robot, sims
        self.lift = sims["stage"][1]
        self.before = self.lift.store.image(1)
        robot.set_position("lift", 0.0)
        robot.enable_torque("upper")

    @property
    def height(self) -> float:
        """Of the lift (m)."""
        return float(self.lift.position) / self.pulses * TURN

    @property
    def pulses(self) -> float:
        """Of a turn."""
        return float(self.lift.store.stored[1].pulses_per_turn)

    def check_given_back(self) -> None:
        assert self.lift.machine.phase is Phase.IDLE
        assert self.lift.store.image(1) == self.before
        assert unfinished(self.robot.buses["stage"]) is None

    def check_stopped(self) -> None:
        """It stopped midway, so its position is unknown, and it moves again once that is known."""
        self.check_given_back()
        assert 0 < self.height < 0.09
        assert self.robot.snapshot().axes["lift"].position is None
        assert not any(axis.moving for axis in self.robot.snapshot().axes.values())
        self.robot.set_position("lift", 0.05)
        assert self.robot.move({"a1": 0.2, "lift": 0.06}).axes["lift"].position == pytest.approx(0.06)
        self.check_given_back()


@pytest.fixture
def one() -> Iterator[Bench]:
    with machine("1-2", lift=True) as (config, sims), Robot(config) as robot:
        yield Bench(robot, sims)


class Start(PerfectLine):
    """The line of the controller; `motions` are their begins and ends (s).

    With `lost` a start has no reply, with `cuts` nothing after it has one.
    """

    def __init__(self, lift: Any, *, lost: bool = False, cuts: bool = False) -> None:
        self.lift, self.lost, self.cuts, self.is_cut = lift, lost, cuts, False
        self.motions: list[tuple[float, float]] = []

    def carry(self, sender: Side, data: Any, at: float) -> list[Delivery]:
        if bytes(data[2:4]) == RUN_ONCE[2:] and sender is Side.DEVICE:
            self.motions.append((self.lift.machine.since, self.lift.machine.until))
            if self.lost:
                self.is_cut = self.cuts
                return []
        if self.is_cut and sender is Side.DEVICE:
            return []
        return super().carry(sender, data, at)


class Goals(PerfectLine):
    """The line of the servos; `at` is when goals were sent that differ from the last ones (s)."""

    def __init__(self) -> None:
        self.last = b""
        self.at: list[float] = []

    def carry(self, sender: Side, data: Any, at: float) -> list[Delivery]:
        if sender is Side.HOST and not asks(data) and data != self.last:
            self.last = bytes(data)
            self.at.append(at)
        return super().carry(sender, data, at)


@pytest.mark.parametrize("duration", [None, 9.0])
def test_servos_and_lift_start_and_end_together(one: Bench, duration: float | None) -> None:
    one.sims["stage"].line = start = Start(one.lift)
    one.sims["arm"].line = goals = Goals()
    result = one.robot.move(GOALS, duration=duration)
    assert one.height == pytest.approx(0.1, abs=TURN / one.pulses)
    assert result.axes["lift"].estimated
    assert result.axes["lift"].position == pytest.approx(0.1, abs=1e-5)
    assert result.axes["a1"].position == pytest.approx(1.0, abs=0.02)
    assert (duration or 0.1 / 0.02) <= result.planned < 9.5
    ((begun, ended),) = start.motions
    assert next(at for at in goals.at if at >= begun - 0.02) == pytest.approx(begun, abs=0.03)
    assert goals.at[-1] == pytest.approx(ended, abs=0.2)  # the last ones are less than a count
    assert ended - begun == pytest.approx(result.planned, abs=0.05)
    one.check_given_back()


def test_lift_moves_alone_and_back(one: Bench) -> None:
    for goal in (0.02, 0.0):
        result = one.robot.move({"lift": goal})
        assert one.height == pytest.approx(goal, abs=TURN / one.pulses)
        assert result.duration >= result.planned
        one.check_given_back()


def test_axis_that_needs_no_pulse_is_left_out(one: Bench) -> None:
    listen(one.sims)
    one.robot.move({"lift": 1e-7})
    one.robot.move({"a1": 0.3, "lift": 0.0})
    assert not orders({"stage": one.sims["stage"]})
    assert one.robot.snapshot().axes["lift"].position == 0.0
    assert one.robot.positions("a1")["a1"] == pytest.approx(0.3, abs=0.02)


# -- what ends it midway ---------------------------------------------------------------------------------------


def test_interrupt_in_the_loop_stops_all(one: Bench) -> None:
    listen({"arm": one.sims["arm"]}, 300)
    with pytest.raises(KeyboardInterrupt):
        one.robot.move(GOALS)
    one.check_stopped()


@pytest.mark.parametrize("goals", [{"lift": 0.1}, GOALS])
def test_interrupt_of_the_wait_stops_the_lift(one: Bench, goals: dict[str, float]) -> None:
    def press(event: object) -> None:
        if isinstance(event, Progress) and "moving" in event.what and one.height > 0.04:
            raise KeyboardInterrupt

    one.robot.buses["stage"].report = press
    with pytest.raises(KeyboardInterrupt):
        one.robot.move({**goals, "lift": 0.1})
    one.robot.buses["stage"].report = lambda event: None
    one.check_given_back()
    assert one.robot.snapshot().axes["lift"].position is None


@pytest.mark.parametrize("frame", range(1, 20))
def test_interrupt_at_each_frame_gives_project_1_back(one: Bench, frame: int) -> None:
    one.sims["stage"].line = Recorded(frame)
    with pytest.raises(KeyboardInterrupt):
        one.robot.move({"a1": 0.3, "lift": 0.02})
    one.check_given_back()


def test_lost_start_stops_all(one: Bench) -> None:
    one.sims["stage"].line = Start(one.lift, lost=True)
    with pytest.raises(MotorbusError):
        one.robot.move(GOALS)
    one.sims["stage"].line = PerfectLine()
    one.check_stopped()


def test_error_names_a_project_that_is_still_lent(one: Bench) -> None:
    one.sims["stage"].line = Start(one.lift, lost=True, cuts=True)
    with pytest.raises(MotorbusError) as caught:
        one.robot.move(GOALS)
    assert any("lift: " in note and "turning" in note for note in caught.value.__notes__)
    assert unfinished(one.robot.buses["stage"]) is not None
    one.sims["stage"].line = PerfectLine()


def test_silent_servo_stops_the_lift(one: Bench) -> None:
    one.sims["arm"].faults = "at 1 s: unplug 2"
    with pytest.raises(MotorbusError):
        one.robot.move(GOALS)
    one.check_given_back()
    assert 0 < one.height < 0.09


@pytest.mark.parametrize("names", [("lift",), ("a1", "lift")])
@pytest.mark.parametrize("how", ["stop", "cancel"])
def test_stop_or_cancel_of_another_task_ends_it(how: str, names: tuple[str, ...]) -> None:
    async def main() -> None:
        with machine("1-2", lift=True) as (config, sims):
            async with AsyncRobot(config) as robot:
                lift = sims["stage"][1]
                before = lift.store.image(1)
                robot.set_position("lift", 0.0)
                moving = asyncio.create_task(robot.move(dict.fromkeys(names, 0.1), duration=8.0))
                while lift.machine.phase is Phase.IDLE or lift.position < 2000:
                    await asyncio.sleep(0)
                if how == "stop":
                    await robot.stop()
                    with pytest.raises(Interrupted):
                        await moving
                else:
                    moving.cancel()
                    with pytest.raises(asyncio.CancelledError):
                        await moving
                assert lift.machine.phase is Phase.IDLE
                assert lift.store.image(1) == before
                assert 2000 <= lift.position < 16000
                assert robot.snapshot().axes["lift"].position is None

    asyncio.run(main())
