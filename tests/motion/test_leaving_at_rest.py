"""What is to be limp at the end is stopped first, looked at until it rests, and then let go."""

from __future__ import annotations

import pytest

from motorbus import Robot
from motorbus.motion.leaving import Leaving
from motorbus.motion.machine import Machine
from motorbus.motion.safety.standstill import READS
from motorbus.simulation.named import Simulation
from tests.support.machines import Cut, listened, machine, said


def moving(robot: Robot, *names: str) -> None:
    """They are on a long way."""
    for name in names:
        axis = robot[name]
        axis.enable_torque()
        axis.departs()
        axis.device.move(4.5, velocity=1.2, wait=False)
    robot["a1"].bus.link.advance(0.5)


def closed(made: Machine, sims: dict[str, Simulation], *names: str) -> tuple[list[str], tuple[str, ...]]:
    """What was sent while a machine was left of which these moved, and what it says of that."""
    robot = Robot.of(made)
    moving(robot, *names)
    listened(sims)
    robot.close()
    return said(sims), robot.warnings


def test_what_moves_is_seen_to_rest_before_it_is_let_go() -> None:
    with machine(arm="1", exit="torque_off") as (made, sims):
        sent, told = closed(made, sims, "a1")
        writes = [number for number, one in enumerate(sent) if "WRITE" in one]
        looks = [one for one in sent[writes[-2] + 1 : writes[-1]] if "READ" in one]
        assert len(looks) >= READS, sent
        assert told == ()
        assert not sims["arm"][1].memory["torque_enable"]


def test_what_rests_already_is_not_looked_at() -> None:
    with machine(arm="1", exit="torque_off") as (made, sims):
        robot = Robot.of(made)
        robot.enable_torque()
        listened(sims)
        robot.close()
        assert len(said(sims)) == 1, said(sims)


def test_who_is_not_seen_to_rest_is_let_go_all_the_same_and_it_is_said() -> None:
    with machine(arm="1-2", exit="torque_off") as (made, sims):
        robot = Robot.of(made)
        moving(robot, "a1", "a2")
        leaving = Leaving(robot)
        stop = leaving.work()
        assert stop is not None
        robot.conductor.run(stop)
        sims["arm"][1].unplug()
        began = robot.buses["arm"].link.now()
        while (work := leaving.work()) is not None:
            robot.conductor.run(work)
        assert leaving.said == ["a1: not seen to rest before it was let go"]
        assert set(leaving.errors) == {"a1"}
        assert not sims["arm"][2].memory["torque_enable"]
        assert robot.buses["arm"].link.now() - began < 2.0  # side by side, not one after the other


@pytest.mark.parametrize("frame", range(5, 9))
def test_an_interruption_ends_the_looking_and_not_the_letting_go(frame: int) -> None:
    with machine(arm="1-2", exit="torque_off") as (made, sims):
        robot = Robot.of(made)
        moving(robot, "a1", "a2")
        sims["arm"].line = Cut(frame)
        with pytest.raises(KeyboardInterrupt):
            robot.close()
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [0, 0]
