"""What is judged before anybody moves, and what a movement tells afterwards: short ways, lost replies, orders."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.errors import LimitExceeded, NoReply, RequestError, Stalled
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.trajectory import Trajectory
from motorbus.session.robot import Robot
from tests.motion.moving.test_journey import Poke
from tests.motion.moving.test_stream import Without
from tests.support.machines import Heard, listened, machine, said

THERE = Trajectory([0.0, 1.0, 2.0], {"a1": [0.4, 0.5, 0.4], "c1": [0.1, 0.2, 0.1]})


def nobody_moved(robot: Robot, sims: Any) -> None:
    assert (sims["arm"][1].raw_position, sims["can"][0x25].raw_position) == (2048, 0)
    assert sims["arm"][1].memory["torque_enable"] == 0
    assert not any(axis.engaged or axis.under_way for axis in robot.axes.values())
    assert not [one for one in said(sims) if "WRITE" in one]


# -- a replay ----------------------------------------------------------------------------------------------------------


def test_a_replay_that_is_refused_for_its_rate_has_moved_nobody() -> None:
    with machine(arm="1", can="0x25") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        with pytest.raises(RequestError, match="20000 Hz is not possible") as told:
            robot.replay(THERE, rate=20000.0)
        assert "nothing was sent" in str(told.value)
        nobody_moved(robot, sims)


def test_a_replay_that_leads_out_of_the_limits_of_a_device_has_moved_nobody() -> None:
    with machine(arm="1", can="0x25", axes={"a1": {"low": None, "high": None}}) as (made, sims):
        far = Trajectory([0.0, 4.0, 8.0], {"a1": [1.0, 2.0, 3.5], "c1": [0.1, 0.2, 0.1]})
        with Robot.of(made) as robot:
            listened(sims)
            with pytest.raises(LimitExceeded, match="a1: the goal 200.5 deg is outside .*the device") as told:
                robot.replay(far)
            assert "nothing was sent" in str(told.value)
            nobody_moved(robot, sims)


def test_who_does_not_accept_the_stop_on_the_way_to_the_beginning_is_told() -> None:
    with machine(arm="1-2") as (made, sims):
        trigger = Poke(300, lambda: sims["arm"][2].unplug())
        with Robot.of(made, report=trigger) as robot:
            both = Trajectory([0.0, 1.0, 2.0], {"a1": [1.0, 1.1, 1.0], "a2": [1.0, 1.1, 1.0]})
            with pytest.raises(NoReply, match="a2") as told:
                robot.replay(both)
            assert any("a2 did not accept the stop" in note for note in told.value.__notes__)
            sims["arm"][2].plug()


def test_a_bus_that_is_at_the_beginning_already_does_not_wait_for_one_that_never_comes() -> None:
    with machine(arm="1", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (2000, 2048 + 240)  # 21 of 23 degrees: it does not arrive
        with pytest.raises(Stalled, match="a1 is not in position"):
            robot.replay(THERE)
        assert sims["can"][0x25].raw_position == 57  # of 0.1 degrees: it was at the beginning, and waited


def test_a_slow_replay_goes_to_its_beginning_as_slowly() -> None:
    took = {}
    for speed in (1.0, 0.5):
        with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
            before = robot.buses["arm"].link.now()
            moved = robot.replay(THERE, speed=speed)
            took[speed] = robot.buses["arm"].link.now() - before - moved.duration
    # 0.4 rad at 90 deg/s and 360 deg/s²: 0.505 s, and twice that
    assert took[0.5] - took[1.0] == pytest.approx(0.505, abs=0.05)


def test_an_axis_on_a_slow_trajectory_may_be_less_far_behind() -> None:
    with machine(arm="1") as (made, sims):
        trigger = Poke(2000, lambda: setattr(sims["arm"][1], "blocked", (2100, 2160)))
        with Robot.of(made, report=trigger) as robot:
            slow = Trajectory([0.0, 5.0, 10.0], {"a1": [0.0, 0.4, 0.8]})
            with pytest.raises(Stalled, match="a1 does not follow") as told:
                robot.replay(slow)
            assert "within 5.7 deg" in str(
                told.value
            )  # 0.1 rad; its limit of 90 deg/s would allow 27 degrees


# -- what is told afterwards -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("goal", [0.0, 0.0007, 0.0021])
def test_an_axis_with_less_than_two_counts_to_go_says_nothing_of_beginning_and_end(goal: float) -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        sims["arm"][2].raw_position = 2049
        moved = robot.move({"a1": 0.5, "a2": goal, "a3": -0.4})
        assert (moved.axes["a2"].started, moved.axes["a2"].ended) == (0.0, 0.0)
        assert moved.axes["a3"].ended > 0.5
        assert moved.ended_apart < 0.02


def test_an_axis_with_two_counts_to_go_begins_and_ends_with_the_others() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        moved = robot.move({"a1": 0.5, "a2": 0.0031})
        assert moved.axes["a2"].ended > 0.5
        assert moved.ended_apart < 0.02


class Deaf(PerfectLine):
    """A line on which the first replies are lost that come once the servos are led."""

    def __init__(self, replies: int) -> None:
        self._left = replies
        self._led = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST and isinstance(data, bytes) and data[4] == 0x83 and data[5] == 42:
            self._led = True
        if sender is Side.DEVICE and self._led and self._left:
            self._left -= 1
            return []
        return super().carry(sender, data, at)


@pytest.mark.parametrize("verb", ["move_by", "jog"])
def test_the_way_that_was_gone_is_true_also_when_the_first_replies_were_lost(verb: str) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        before = robot["a1"].position()
        sims["arm"].line = Deaf(4)
        way = robot["a1"].move_by(0.05, velocity=1.0) if verb == "move_by" else robot["a1"].jog(0.5, 0.3)
        sims["arm"].line = Heard()
        assert way == pytest.approx(robot["a1"].position() - before, abs=1e-6)


def test_an_axis_that_is_blocked_on_a_tiny_way_has_not_arrived() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (2040, 2050)
        with pytest.raises(Stalled, match=r"a1 is not in position: its goal is 1\.0 deg"):
            robot.move({"a1": 0.018})


def test_an_axis_with_no_way_to_go_may_give_way_under_its_load() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"][2].blocked = (2057, 2090)  # 0.8 degrees beside where it shall stay
        assert robot.move({"a1": 0.3, "a2": 0.0}).axes["a2"].ended == 0.0


def test_orders_are_told_when_they_were_gone() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        moved = robot.move({"a1": 0.5, "c1": 0.3})
        assert 0 < moved.started_apart < 0.002  # c1 acknowledges its order, a packet for servos has no reply
        assert "orders left within" in str(moved)


def test_an_axis_that_moves_before_all_begin_is_told_without_saying_that_nothing_was_sent() -> None:
    with machine(arm="1", can="0x25") as (made, sims), Robot.of(made) as robot:
        receive, heard = sims["can"].simulator.receive, 0

        def turning(data: Any, at: float) -> None:
            nonlocal heard
            heard += 1
            sims["can"][0x25].raw_position = 6 * heard
            receive(data, at)

        sims["can"].simulator.receive = turning  # type: ignore[method-assign]
        with pytest.raises(RequestError, match="c1 is moving") as told:
            robot.move({"a1": 0.5, "c1": 0.3})
        assert sims["arm"][1].memory["torque_enable"] == 1
        assert "nobody was moved" in str(told.value)
        assert "nothing was sent" not in str(told.value)


def test_no_goal_leaves_once_it_is_seen_that_an_axis_does_not_follow() -> None:
    with machine(arm="1-2") as (made, sims):
        trigger = Poke(600, lambda: setattr(sims["arm"][2], "blocked", (1900, 2200)))
        with Robot.of(made, report=trigger) as robot:
            sims["arm"].line = wire = Heard()
            with pytest.raises(Stalled, match="a2 does not follow"):
                robot.move({"a1": 1.0, "a2": -1.0}, duration=2.0)
            frames = [one for one in wire.sent if isinstance(one, bytes)]
            last = max(number for number, one in enumerate(frames) if one[4:6] == b"\x83\x2a")
            assert [one[4] for one in frames[last + 1 : last + 2]] == [
                0x82
            ]  # what came back to that was judged


def test_a_first_goal_that_is_lost_is_in_the_time_of_its_order_all_the_same() -> None:
    with machine(arm="1", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = Without(1)
        assert robot.move({"a1": 0.5, "c1": 0.3}).started_apart < 0.002
