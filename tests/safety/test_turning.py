"""What goes on without an end goes on, as far as is known, until its device has accepted a stop: none that was lost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import inf
from threading import current_thread, main_thread
from typing import Any

import pytest

from motorbus.core.operation import Data, Effect, Exchange, Goal, Pause
from motorbus.errors import LimitExceeded, Refused, VerificationFailed
from motorbus.families.feetech.wire import Instruction
from motorbus.families.stepper.driver.commands import stop_motor, stop_project
from motorbus.families.stepper.driver.node import Node
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.leaving import goes_on
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard
from motorbus.motion.safety.turning import Resting, Turning
from motorbus.session.robot import Robot
from tests.motion.machines import Cut, machine

BY_HAND = "goal_velocity"


class Lossy(PerfectLine):
    """A wire that swallows every WRITE of the host, or every answer to one, while it is told to."""

    def __init__(self) -> None:
        self.loses: Side | None = None
        self._asked = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.HOST:
            self._asked = data[4]
        if sender is self.loses and self._asked == Instruction.WRITE:
            return []
        return super().carry(sender, data, at)


class Pressed(Cut):
    """Ctrl-C as Python gives it: to the main thread, and to no other that sends."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if current_thread() is not main_thread():
            return PerfectLine.carry(self, sender, data, at)
        return super().carry(sender, data, at)


@contextmanager
def wheel(**options: Any) -> Iterator[tuple[Any, Any, Any]]:
    """A machine of two axes, the first of which is a wheel with torque; the line of both, and its simulator."""
    with machine(arm="1-2", exit="hold", **options) as (made, sims), Robot.of(made) as robot:
        line = sims["arm"].line = Lossy()
        robot["a1"].device.set_mode("velocity")
        robot["a1"].enable_torque()
        yield robot, line, sims["arm"][1]


def test_only_what_it_accepts_ends_it_and_an_order_that_came_later_goes_on() -> None:
    accepted = {1: 3, 2: 0}
    turning = Turning(accepted.__getitem__)
    turning.begins(1)
    first = turning.last(1)
    assert turning.goes_on(1)
    assert not turning.goes_on(2)
    turning.begins(1)
    turning.rests(1, first)
    assert turning.goes_on(1)
    turning.rests(1, turning.last(1))
    assert not turning.goes_on(1)
    turning.begins(1)
    accepted[1] += 1
    assert not turning.goes_on(1)
    turning.rests(1, None)
    assert turning.last(1) is None


def test_who_was_stopped_for_certain_rests_unless_it_was_ordered_on_since() -> None:
    with wheel() as (robot, _, _), robot.attended():
        axis = robot["a1"]
        axis.device.set_velocity(1.0)
        early = Resting(axis)
        axis.device.set_velocity(0.5)
        early.certain()
        assert goes_on(axis)
        Resting(axis).certain()
        assert not goes_on(axis)
        axis.device.set_velocity(1.0)


# -- a stop that is lost on the wire -----------------------------------------------------------------------------------


@pytest.mark.parametrize("lasts", [None, 0.5])
def test_a_stop_that_was_lost_is_none_and_the_end_of_attending_stops_it(lasts: float | None) -> None:
    with wheel() as (robot, line, sim):
        axis = robot["a1"]
        with suppress(Refused), robot.attended(lasts=lasts):
            axis.device.set_velocity(1.0)
            line.loses = Side.HOST
            with pytest.raises(VerificationFailed):
                axis.stop()
            line.loses = None
            assert goes_on(axis)
            if lasts is not None:  # nobody beats, and the lease is lost
                robot["a1"].bus.run(iter(Pause(2.0)))
                assert sim.memory[BY_HAND] == 0
        assert sim.memory[BY_HAND] == 0
        assert not goes_on(axis)


def test_a_stop_that_was_lost_at_the_end_of_attending_is_said_once_more() -> None:
    with wheel() as (robot, line, sim):
        with suppress(VerificationFailed), robot.attended():
            robot["a1"].device.set_velocity(1.0)
            line.loses = Side.HOST
        assert sim.memory[BY_HAND] != 0
        line.loses = None
        robot["a1"].bus.run(iter(Pause(1.0)))
        assert sim.memory[BY_HAND] == 0


def test_two_interruptions_of_the_end_of_attending_do_not_keep_it_going() -> None:
    with (
        suppress(KeyboardInterrupt),
        machine(arm="1-2", exit="hold") as (made, sims),
        Robot.of(made) as robot,
    ):
        robot["a1"].device.set_mode("velocity")
        robot["a1"].enable_torque()
        with suppress(KeyboardInterrupt), robot.attended():
            robot["a1"].device.set_velocity(1.0)
            sims["arm"].line = Pressed(2, 3)  # the stop, and what reads it back
        robot["a1"].bus.run(iter(Pause(1.0)))
        assert sims["arm"][1].memory[BY_HAND] == 0
    assert sims["arm"][1].memory[BY_HAND] == 0


# -- a stop that is accepted -------------------------------------------------------------------------------------------


Act = Callable[[Any], object]


@pytest.mark.parametrize(
    "act",
    [
        lambda axis: axis.stop(),
        lambda axis: axis.disable_torque(),
        lambda axis: axis.device.stop(),
        lambda axis: axis.device.disable_torque(),
        lambda axis: axis.device.set_velocity(0.0),
    ],
)
@pytest.mark.parametrize("other", [False, True])
def test_what_is_answered_ends_it_for_this_one_and_for_no_other(act: Act, other: bool) -> None:
    with wheel() as (robot, _, sim), robot.attended():
        axis, second = robot["a1"], robot["a2"]
        second.device.set_mode("velocity")
        second.enable_torque()
        axis.device.set_velocity(1.0)
        act(second if other else axis)
        assert goes_on(axis) is other
        assert (sim.memory[BY_HAND] != 0 and bool(sim.memory["torque_enable"])) is other


@pytest.mark.parametrize("act", [lambda axis: axis.stop(), lambda axis: axis.disable_torque()])
def test_where_nobody_answers_writes_it_is_what_was_read_back_that_ends_it(act: Act) -> None:
    with wheel() as (robot, line, _), robot.attended():
        axis = robot["a1"]
        axis.device.set_velocity(1.0)
        line.loses = Side.DEVICE
        act(axis)
        assert not goes_on(axis)
        line.loses = None


def test_an_emergency_stop_that_was_obeyed_ends_it() -> None:
    with wheel() as (robot, _, _), suppress(Refused), robot.attended():
        robot["a1"].device.set_velocity(1.0)
        robot.estop()
        assert not goes_on(robot["a1"])
        robot.reset()


def test_a_stepper_has_stopped_once_it_has_accepted_both_that_end_what_it_does() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        bus, gate = robot["lift"].bus, robot["lift"].bus.admit
        for order in ((stop_project, stop_motor), (stop_motor, stop_motor, stop_project)):
            gate.turning.begins(1)
            for say in order:
                assert goes_on(robot["lift"])
                bus.run(say(Node()))
            assert not goes_on(robot["lift"])


def test_an_order_that_is_refused_sets_nothing_going_and_leaves_known_where_it_is() -> None:
    there: list[float | None] = [1.0]
    gate = Gate()
    gate.guards[1] = Guard(
        "lift",
        Bounds(0.0, 2.0),
        measures=False,
        reckons=lambda: there[0],
        leaves=lambda: there.__setitem__(0, None),
    )
    ways = tuple(Goal(1, "relative", way, -inf, inf) for way in (0.5, -1.5))
    with pytest.raises(LimitExceeded):
        gate(Exchange(b"", effect=Effect.MOTION, goals=ways))
    assert there == [1.0]
    assert not gate.goes_on(1)
