"""Who told an axis last has the command over it, and nobody else's goals leave any more."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Exchange
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError
from motorbus.motion.command import Command
from motorbus.session.robot import Robot
from tests.motion.machines import machine


def test_the_command_is_lost_with_the_next_order_from_elsewhere() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        both = list(robot.axes.values())
        mine = Command(both)
        mine.depart()
        mine.check()
        assert mine.held() == both
        robot["a1"].enable_torque()
        with pytest.raises(Interrupted, match="a1: the movement was ended by another order"):
            mine.check()
        assert [axis.name for axis in mine.held()] == ["a2"]
        with pytest.raises(Interrupted):
            mine.depart()


@pytest.mark.parametrize("verb", ["stop", "hold", "disable_torque", "enable_torque"])
def test_every_verb_that_tells_an_axis_something_counts(verb: str) -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        mine = Command([robot["a1"]])
        getattr(robot["a1"], verb)()
        assert mine.lost() is not None
        later = Command([robot["a1"]])
        robot["a1"].position()
        assert later.lost() is None


def test_a_stop_of_the_bus_counts_and_one_of_another_device_does_not() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        one, other = Command([robot["a1"]]), Command([robot["a2"]])
        robot["a1"].bus.run(robot["a1"].able["disable_torque"](robot["a1"].device))  # past the axis
        assert isinstance(one.lost(), Interrupted)
        assert other.lost() is None
        robot.estop()
        assert isinstance(other.lost(), Interrupted)


def test_a_goal_that_is_guarded_does_not_leave_after_a_stop() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        axis, bus = robot["a1"], robot["a1"].bus
        axis.enable_torque()
        train = bus.run(axis.able["train"]([axis.device], rate=bus.rate))
        mine = Command([axis])
        (goal,) = train.goals({1: axis.spec.to_device(0.1)})
        guarded = mine.guarded(goal)
        assert (guarded.request, guarded.goals, guarded.effect) == (goal.request, goal.goals, goal.effect)
        bus.run(guarded)
        bus.link.advance(0.001)
        assert sims["arm"][1].memory["goal_position"] == 2048 + 65
        axis.stop()
        (goal,) = train.goals({1: axis.spec.to_device(0.2)})
        with pytest.raises(Interrupted, match="another order"):
            bus.run(mine.guarded(goal))
        assert sims["arm"][1].memory["goal_position"] < 2048 + 66


def test_what_an_exchange_is_refused_for_itself_comes_first_and_its_other_form_is_guarded_too() -> None:
    refused = LimitExceeded("its own reason")

    def own(_: object) -> MotorbusError | None:
        return refused

    def other() -> Exchange[None]:
        return Exchange(b"other", refusal=own)

    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        mine = Command([robot["a1"]])
        guarded: Exchange[None] = mine.guarded(Exchange(b"one", other=other))
        assert guarded.other is not None
        again = guarded.other()
        assert guarded.refusal is not None
        assert again.refusal is not None
        assert guarded.refusal(lambda _: 0) is None
        assert again.refusal(lambda _: 0) is refused
        robot["a1"].hold()
        assert isinstance(guarded.refusal(lambda _: 0), Interrupted)


def test_stopping_visits_those_that_are_still_commanded_and_tells_who_did_not_accept() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        mine = Command(robot.axes.values())
        mine.depart()
        robot["a1"].disable_torque()
        sims["arm"][2].unplug()
        errors = robot["a1"].bus.run(mine.stop())
        assert list(errors) == ["a2"]
        assert {name: axis.under_way for name, axis in robot.axes.items()} == {
            "a1": False,
            "a2": True,
            "a3": False,
        }
        assert sims["arm"][1].memory["torque_enable"] == 0  # somebody let it go, and that is respected
        sims["arm"][2].plug()
