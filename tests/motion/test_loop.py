"""The control loop: targets, limits, ownership, silence, late hosts, and its use without a clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice, pairwise
from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.core.steps import Sleep
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, NoReply, RequestError
from motorbus.link.base import Delivery, Side
from motorbus.motion.program import OnBuses
from motorbus.motion.robot import Robot
from tests.support.machines import Recorded, listen, machine, orders


def test_entering_writes_nothing_and_torque_comes_with_the_first_target() -> None:
    with machine("1-2", "1") as (config, sims), Robot(config) as robot:
        listen(sims)
        with robot.loop(50) as loop:
            for _ in islice(loop, 5):
                assert not orders(sims)
            loop.set_target("a2", 0.1)
            for _ in islice(loop, 30):
                pass
        torque = [sims["arm"][node].memory["torque_enable"] for node in (1, 2)]
        assert torque == [0, 1]
        assert abs(robot.positions()["a2"] - 0.1) < 0.01
        assert robot.snapshot().axes["a2"].target is None


@pytest.mark.parametrize("name", ["a1", "c1"])
def test_a_target_is_followed_within_velocity_and_acceleration(name: str) -> None:
    with machine("1", "1") as (config, _), Robot(config) as robot, robot.loop(50) as loop:
        places = []
        for state in loop:
            loop.set_target(name, 0.8 if state.number < 40 else -0.2)
            places.append(loop._loop.axes[name].sent)
            if state.number > 150:
                break
        speeds = [(b - a) * 50 for a, b in pairwise(places[2:])]
        gains = [(b - a) * 50 for a, b in pairwise(speeds)]
        axis = config.axes[name]
        assert max(map(abs, speeds)) <= axis.max_velocity * 1.0001
        assert max(map(abs, gains)) <= axis.acceleration * 1.01
        assert abs(state.position[name] + 0.2) < 0.02


def test_a_target_outside_the_limits_is_refused_or_clamped_and_counted() -> None:
    with machine("1") as (config, _), Robot(config) as robot:
        with robot.loop(50) as loop:
            for wrong in (9.0, -9.0, float("nan"), float("inf")):
                with pytest.raises(LimitExceeded):
                    loop.set_target("a1", wrong)
            with pytest.raises(RequestError, match="not in this loop"):
                loop.set_target("c1", 0.0)
        with robot.loop(50, policy="clamp") as loop:
            for _ in islice(loop, 100):
                loop.set_target("a1", 9.0)
            with pytest.raises(LimitExceeded):
                loop.set_target("a1", float("nan"))
        assert loop.statistics.clamped["a1"] == 100
        assert robot.positions()["a1"] == pytest.approx(float(config.axes["a1"].high or 0), abs=0.01)


def test_an_axis_outside_its_limits_may_come_back() -> None:
    with (
        machine("1", axes={"a1": {"low": "20 deg", "high": "90 deg"}}) as (config, _),
        Robot(config) as robot,
    ):
        with pytest.raises(LimitExceeded):
            robot.move({"a1": 0.1})
        robot.move({"a1": 0.5})
        assert robot.positions()["a1"] == pytest.approx(0.5, abs=0.01)


def test_the_end_of_the_block_brakes() -> None:
    with machine("1", "1") as (config, _), Robot(config) as robot:
        with robot.loop(50) as loop:
            for state in loop:
                loop.set_target("a1", 2.0)
                loop.set_target("c1", 0.8)
                if state.number > 20:
                    break
        here = robot.positions()
        assert not robot.snapshot().axes["a1"].moving
        assert robot.stop(verify=True).axes["c1"].at_rest
        assert 0.2 < here["a1"] < 1.5
        assert robot.positions()["a1"] == pytest.approx(here["a1"], abs=0.05)


def lead(robot: Robot, cycle: int, then: Callable[[], object]) -> None:
    """Lead a1 and c1 to 0.5; in this cycle something happens that ends the loop."""
    with robot.loop(50) as loop:
        for state in loop:
            loop.set_target("a1", 0.5)
            loop.set_target("c1", 0.5)
            if state.number == cycle:
                then()
            assert state.number < cycle + 40


@pytest.mark.parametrize("how", ["stop", "torque", "device", "estop", "move"])
def test_another_source_ends_the_loop_before_another_goal_leaves(how: str) -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        takes: dict[str, Any] = {
            "stop": lambda: robot.stop("c1"),
            "torque": lambda: robot.disable_torque("a1"),
            "device": lambda: robot.buses["can"].run(robot.axes["c1"].driver.stop(robot.axes["c1"].device)),
            "estop": robot.estop,
            "move": lambda: robot.move({"c1": 0.0}),
        }

        def take() -> None:
            takes[how]()
            listen(sims)

        with pytest.raises(Interrupted):
            lead(robot, 20, take)
        goals = [
            data for data in orders(sims) if not isinstance(data, bytes) and data.data[:3] == b"\x22\x03\x60"
        ]
        assert len(goals) <= 2  # the hold of the stop that ends the block


@pytest.mark.parametrize("name", ["a1", "c1"])
def test_no_goal_leaves_after_a_stop_between_plan_and_write(name: str) -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot, robot.loop(50) as loop:
        for state in loop:
            loop.set_target(name, 0.5)
            if state.number > 10:
                break
        listen(sims)
        (group,) = (one for one in loop._loop.groups if name in {axis.name for axis in one.axes.values()})
        stream: Any = group.stream

        class Stopped:
            """Another thread stops the axis when the goals have been made."""

            def goals(self, to: Any) -> Any:
                made = stream.goals(to)
                robot.axes[name].status.stopped()
                return made

        group.stream = Stopped()  # type: ignore[assignment]
        with pytest.raises(Interrupted):
            next(iter(loop))
        assert not orders(sims)


class Lossy(Recorded):
    """A line that loses all that node 1 says while `loses` is true."""

    loses = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        found = super().carry(sender, data, at)
        is_lost = self.loses and sender is Side.DEVICE and isinstance(data, bytes) and data[2] == 1
        return [] if is_lost else found


def test_a_missing_axis_gets_no_goals_and_goes_on_when_it_is_back() -> None:
    with machine("1-2") as (config, sims), Robot(config) as robot, robot.loop(50) as loop:
        line = Lossy()
        for state in loop:
            loop.set_target("a1", 0.6)
            loop.set_target("a2", 0.6)
            if state.number == 10:
                sims["arm"].line = line
                line.loses = True
            line.loses = line.loses and state.number < 20
            if state.number > 80:
                break
        assert loop.statistics.lost["a1"] in range(3, 12)
        assert "a2" not in loop.statistics.lost
        assert state.position["a1"] == pytest.approx(0.6, abs=0.02)


def test_a_silent_axis_ends_the_loop() -> None:
    with machine("1", "1") as (config, sims), Robot(config) as robot:
        with pytest.raises(NoReply, match=r"c1 \(can#1\) has not answered"):
            lead(robot, 10, sims["can"][1].unplug)
        assert robot.stop("a1", verify=True).axes["a1"].at_rest


@pytest.mark.parametrize(("late", "ends"), [(0.1, False), (0.7, True)])
def test_a_late_host_is_counted_and_ends_a_movement_after_half_a_second(late: float, ends: bool) -> None:
    def run(robot: Robot) -> Any:
        with robot.loop(50) as loop:
            for state in loop:
                loop.set_target("a1", 1.0)
                if state.number == 10:
                    robot.carry_out(pause(robot, late))
                if state.number > 40:
                    break
        return loop.statistics

    with machine("1") as (config, _), Robot(config) as robot:
        if ends:
            with pytest.raises(Interrupted, match="held up"):
                run(robot)
            return
        statistics = run(robot)
        assert statistics.overruns == 1
        assert statistics.skipped == pytest.approx(late * 50, abs=1)


def test_positions_and_targets_without_a_clock() -> None:
    with machine("1", "1") as (config, _), Robot(config) as robot, robot.loop(50, policy="clamp") as loop:
        assert loop.read() == pytest.approx({"a1": 0.0, "c1": 0.0}, abs=0.01)
        sent: Mapping[str, float] = {}
        for _ in range(80):
            sent = loop.write({"a1": 9.0, "c1": 0.2}, elapsed=0.02)
            robot.carry_out(pause(robot, 0.02))
        assert sent["a1"] == pytest.approx(loop.read()["a1"], abs=0.3)
        assert sent["c1"] == pytest.approx(0.2)
        robot.carry_out(pause(robot, 3.0))
        assert loop.write({"c1": 0.2}, elapsed=0.02)["c1"] == pytest.approx(0.2)


async def pause(robot: Robot, seconds: float) -> None:
    """Let time pass on all buses."""
    await OnBuses({bus: Sleep(seconds) for bus in robot.buses.values()})


def test_a_rate_is_chosen_and_one_that_the_wire_cannot_carry_is_refused() -> None:
    with machine("1-6") as (config, _), Robot(config) as robot:
        with robot.loop() as loop:
            assert loop.statistics.rate == 100
        with pytest.raises(RequestError, match="Hz"):
            robot.loop(5000)
        with pytest.raises(RequestError, match="Hz"):
            robot.loop(2)


def test_a_loop_that_cannot_begin_is_not_counted() -> None:
    with machine("1") as (config, sims), Robot(config) as robot:
        next(iter(sims.values()))[1].unplug()
        with pytest.raises(NoReply):
            robot.jog("a1", 0.5, 1.0)
        assert robot.loops == 0


def test_axes_that_follow_no_setpoints_are_left_out_or_refused_by_name() -> None:
    with machine("1", lift=True) as (config, _), Robot(config) as robot:
        with robot.loop(50) as loop:
            assert list(loop.read()) == ["a1"]
        with pytest.raises(RequestError, match="lift"):
            robot.loop(50, ["a1", "lift"])


def test_jog_stops_at_the_limit_and_refuses_what_is_too_fast() -> None:
    with (
        machine("1", axes={"a1": {"low": "-20 deg", "high": "20 deg"}}) as (config, _),
        Robot(config) as robot,
    ):
        result = robot.jog("a1", 0.5, 3.0)
        assert result.positions["a1"] == pytest.approx(20 * 3.14159 / 180, abs=0.01)
        for wrong in (0.0, 5.0, float("nan")):
            with pytest.raises(LimitExceeded):
                robot.jog("a1", wrong, 1.0)
        with pytest.raises(MotorbusError):
            robot.jog("a1", 0.5, -1.0)
        calls = iter(range(100))
        robot.jog("a1", -0.5, until=lambda: next(calls) > 20)
        assert 0.1 < robot.positions()["a1"] < 0.3


def test_an_unlimited_axis_jogs_at_its_velocity() -> None:
    with machine(can="1", axes={"c1": {"low": None, "high": None}}) as (config, _), Robot(config) as robot:
        robot.jog("c1", -0.4, 1.0)
        assert robot.positions()["c1"] == pytest.approx(-0.4, abs=0.08)
