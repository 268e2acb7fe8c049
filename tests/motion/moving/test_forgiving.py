"""Which errors of an exchange are values while axes are led, and which are raised."""

from __future__ import annotations

import pytest

from motorbus.core.family import Positions
from motorbus.errors import Interrupted
from motorbus.motion.command import Command
from motorbus.motion.moving.forgiving import LOST, forgiven
from motorbus.session.robot import Robot
from tests.motion.machines import machine


def test_what_is_lost_is_a_value_and_the_others_are_heard() -> None:
    with machine(can="0x25-0x27") as (made, sims), Robot.of(made) as robot:
        bus, axes = robot["c1"].bus, list(robot.axes.values())
        train = bus.run(axes[0].able["train"]([axis.device for axis in axes], rate=bus.rate))
        sims["can"][0x26].unplug()
        first, second, third = bus.run(forgiven(train.positions))
        assert isinstance(second, LOST)
        assert isinstance(first, Positions)
        assert isinstance(third, Positions)
        sims["can"][0x26].plug()


def test_what_was_refused_is_raised() -> None:
    with machine(can="0x25-0x27") as (made, _), Robot.of(made) as robot:
        bus, axes = robot["c1"].bus, list(robot.axes.values())
        train = bus.run(axes[0].able["train"]([axis.device for axis in axes], rate=bus.rate))
        mine = Command(axes)
        robot["c2"].stop()
        goals = [mine.guarded(one) for one in train.goals(dict.fromkeys(train.nodes, 0.0))]
        with pytest.raises(Interrupted, match="c2: the movement was ended by another order"):
            bus.run(forgiven([*goals, *train.positions]))
