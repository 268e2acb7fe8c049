"""Row L12 for axes: what is known of a machine when a port of it was gone, and is there again."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.steps import Sleep
from motorbus.errors import Faulted, LinkLost, NotHomed
from motorbus.motion.safety.gate import Gate
from motorbus.session.robot import Robot
from tests.support.machines import Heard, machine

AWAY = 0.5


async def pause(seconds: float) -> None:
    await Sleep(seconds)


def wait(robot: Robot, bus: str, seconds: float) -> None:
    """Let time pass on a bus."""
    there: Any = robot.buses[bus]
    there.run(pause(seconds))


def gone_and_back(robot: Robot, bus: str) -> None:
    """Pull the adapter, notice that, and put it back."""
    there: Any = robot.buses[bus]
    there.link.unplug(there.link.now(), AWAY)
    with pytest.raises(LinkLost):
        there.run(pause(10.0))
    there.run(pause(AWAY + 0.1))
    assert there.loss_count == 1


def test_where_axes_are_is_asked_anew() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        robot.positions()
        gone_and_back(robot, "arm")
        gate = robot.buses["arm"].interlock
        assert isinstance(gate, Gate)
        for axis in robot.axes.values():
            guard = gate.guards[axis.spec.node]
            assert axis.track.sample is None
            assert guard.track is not None
            assert guard.track.sample is None
        sims["arm"].line = line = Heard()
        robot["a1"].enable_torque()
        robot["a1"].device.move(3.2, velocity=0.5, wait=False)
        first = line.sent[0]
        assert isinstance(first, bytes)
        assert first[4] == 0x02, "a read comes before anything is written"


def test_one_that_has_restarted_meanwhile_is_at_fault() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        robot.move({"a1": 0.2, "a2": 0.2})
        sims["arm"][1].power_cycle()
        gone_and_back(robot, "arm")
        before = sims["arm"][1].raw_position
        with pytest.raises(Faulted, match="a1 is at fault"):
            robot.move({"a1": 0.5})
        robot["a2"].enable_torque()
        assert list(robot.faults) == ["a1"]
        assert sims["arm"][1].memory["torque_enable"] == 0
        assert abs(sims["arm"][1].raw_position - before) <= 1


def test_one_that_kept_its_torque_goes_on_when_it_is_told_to_and_not_before() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        robot.move({"a1": 0.2, "a2": 0.2})
        gone_and_back(robot, "arm")
        sims["arm"].line = line = Heard()
        wait(robot, "arm", 1.0)
        assert line.sent == []
        assert robot.move({"a1": 0.4}).axes["a1"].present == pytest.approx(0.4, abs=0.02)


def test_a_movement_that_was_cut_off_is_not_taken_up_again() -> None:
    with machine(arm="1-2", can="0x25", exit="leave") as (made, sims), Robot.of(made) as robot:
        link: Any = robot.buses["arm"].link
        link.unplug(link.now() + 0.6, AWAY)
        with pytest.raises(LinkLost):
            robot.move({"a1": 1.0, "c1": 0.6}, duration=2.0)
        wait(robot, "arm", AWAY + 0.5)
        here = robot["a1"].position()
        assert abs(here - 1.0) > 0.1, "it was cut off"
        wait(robot, "arm", 1.0)
        assert robot["a1"].position() == pytest.approx(here, abs=0.01)
        wait(robot, "can", 1.0)
        assert sims["can"][0x25].status()["moving"] in (0, False)


def test_where_a_stepper_stands_is_not_known_any_more() -> None:
    with machine(lift=True, exit="leave") as (made, _), Robot.of(made) as robot:
        robot["lift"].declare(0.05)
        gone_and_back(robot, "stage")
        assert robot["lift"].estimated is None
        with pytest.raises(NotHomed, match="where it is is not known"):
            robot["lift"].move(0.06)


def test_what_waits_in_a_servo_is_not_let_begin_unseen() -> None:
    with machine(arm="1", exit="leave") as (made, _), Robot.of(made) as robot:
        gate = robot.buses["arm"].interlock
        assert isinstance(gate, Gate)
        waiting = gate._waiting
        gone_and_back(robot, "arm")
        assert gate._waiting is not waiting
