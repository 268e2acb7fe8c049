"""Leaving a loop, on simulated buses in virtual time: who is on its way brakes, whatever befalls another."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise
from math import radians, tau
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, LinkError
from motorbus.motion.loop.faces import Loop
from motorbus.session.robot import Robot
from tests.motion.loop.test_rounds import RATE, cycles, looping
from tests.support.machines import Cut, Heard, machine

QUICK = radians(90)


def place(loop: Loop, name: str) -> Any:
    """An axis in a loop."""
    return loop._rounds.places[name]


def speed(loop: Loop, name: str) -> float:
    """How fast its small goals go (rad/s)."""
    way = place(loop, name)._follower
    return 0.0 if way is None else way.velocity


def test_leaving_brakes_whoever_is_under_way() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        with suppress(ZeroDivisionError), robot.loop(RATE) as loop:
            loop.goal.update({"a1": 2.0, "a2": 0.0})
            state = cycles(loop, 60)
            raise ZeroDivisionError
        one = place(loop, "a1")
        way = one.sent - state.position["a1"]
        assert 0.5 * radians(90) ** 2 / radians(360) < way < 0.5
        assert not robot["a1"].under_way
        sims["arm"].line = line = Heard()
        robot.buses["arm"].link.advance(0.5)  # type: ignore[attr-defined]
        assert robot["a1"].position() == pytest.approx(one.sent, abs=0.01)
        assert all(
            data[4] in (0x02, 0x82) for data in line.sent if isinstance(data, bytes)
        )  # nothing but reading any more


def test_leaving_what_was_stopped_or_has_not_begun_sends_nothing() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        with robot.loop(RATE):
            pass
        with robot.loop(RATE) as loop:
            loop.goal["a1"] = 1.0
            cycles(loop, 40)
            robot["a1"].stop()
            sims["arm"].line = line = Heard()
        assert not line.sent


def test_leaving_visits_the_other_buses_when_one_is_gone() -> None:
    with machine(arm="1", can="0x21", exit="leave") as (made, _), Robot.of(made) as robot:
        loop = robot.loop(RATE)

        def fails() -> None:
            with loop:
                loop.goal.update({"a1": 1.0, "c1": 0.6})
                cycles(loop, 30)
                robot.buses["arm"].link.unplug()  # type: ignore[attr-defined]
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError) as left:
            fails()
        assert "on leaving the loop" in left.value.__notes__[0]
        assert place(loop, "c1").arrived
        assert not robot["c1"].under_way
        robot.buses["arm"].link.plug()  # type: ignore[attr-defined]


@pytest.mark.parametrize("most", ["8 deg", "12 deg", "15 deg"])
def test_braking_looks_where_the_axis_is(most: str) -> None:
    with (
        machine(arm="1-2", exit="leave", axes={"a1": {"max_step": most}}) as (made, _),
        Robot.of(made) as robot,
    ):
        with robot.loop(RATE) as loop:
            loop.goal.update({"a1": 2.0, "a2": 2.0})
            cycles(loop, 70)
            assert speed(loop, "a1") == pytest.approx(QUICK)
        assert [speed(loop, name) for name in ("a1", "a2")] == [0.0, 0.0]
        assert not robot["a1"].under_way
        assert robot["a1"].position() == pytest.approx(place(loop, "a1").sent, abs=0.02)


def test_an_axis_that_is_held_back_leaves_no_other_unbraked() -> None:
    axes = {"a2": {"max_step": "10 deg"}}
    with machine(arm="1-2", exit="leave", axes=axes) as (made, sims), Robot.of(made) as robot:
        loop = robot.loop(RATE)

        def leaves() -> None:
            with loop:
                loop.goal.update({"a1": 2.0, "a2": 2.0})
                cycles(loop, 60)
                here = sims["arm"][2].raw_position
                sims["arm"][2].blocked = (here - 30, here + 5)
                one = place(loop, "a2")
                while abs(one.sent - one.position) < 0.155:
                    cycles(loop, 1)
                assert speed(loop, "a1") == pytest.approx(QUICK)

        with pytest.raises(LimitExceeded, match="a2: the goal"):
            leaves()
        assert [speed(loop, name) for name in ("a1", "a2")] == [0.0, 0.0]
        assert abs(place(loop, "a2").sent - place(loop, "a2").position) < radians(10)
        assert place(loop, "a1").sent - place(loop, "a2").sent > 0.1  # it had all of its way to brake
        assert robot["a1"].position() == pytest.approx(place(loop, "a1").sent, abs=0.02)
        assert not any(axis.under_way for axis in robot.axes.values())


def test_a_goal_that_was_set_last_moves_nobody_any_more() -> None:
    with machine(arm="1-2", exit="leave") as (made, _), Robot.of(made) as robot:
        with robot.loop(RATE) as loop:
            loop.goal.update({"a1": 2.0, "a2": 0.0})
            cycles(loop, 60)
            loop.goal["a2"] = 1.0
        assert robot["a2"].position() == pytest.approx(0.0, abs=0.01)
        assert robot["a1"].position() > 0.8


class Stopping(Heard):
    """A wire on which something is done while the host sends its frame of this number."""

    def __init__(self, number: int, act: Any) -> None:
        super().__init__()
        self.number = number
        self.act = act

    def carry(self, sender: Any, data: Any, at: float) -> Any:
        found = super().carry(sender, data, at)
        if len(self.sent) == self.number:
            self.number = -1
            self.act()
        return found


def braked_while(number: int) -> tuple[int, Loop, Robot]:
    """Two axes brake, and somebody moves a2 at this frame of it; how many there were, the loop and the robot."""
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        with robot.loop(RATE) as loop:
            loop.goal.update({"a1": 2.0, "a2": 2.0})
            cycles(loop, 60)
            sims["arm"].line = line = Stopping(number, lambda: robot["a2"].departs())
        return len(line.sent), loop, robot


def test_who_is_told_to_move_meanwhile_is_left_alone_and_the_others_brake_whenever_that_is() -> None:
    frames, _, _ = braked_while(0)
    assert frames > 40
    for number in {*range(1, frames, 4), frames - 1, frames}:
        _, loop, robot = braked_while(number)
        assert speed(loop, "a1") == 0.0
        assert [axis.under_way for axis in robot.axes.values()] == [False, True]


def test_a_bus_that_fails_meanwhile_is_told_nothing_more_and_the_other_brakes() -> None:
    with machine(arm="1", can="0x21", exit="leave") as (made, sims), Robot.of(made) as robot:
        link: Any = robot.buses["arm"].link
        loop = robot.loop(RATE)

        def leaves() -> None:
            with loop:
                loop.goal.update({"a1": 1.0, "c1": 0.6})
                cycles(loop, 30)
                sims["can"].line = Stopping(5, link.unplug)

        with pytest.raises(LinkError):
            leaves()
        assert not place(loop, "a1").arrived
        assert place(loop, "c1").arrived
        assert [robot[name].under_way for name in ("a1", "c1")] == [True, False]
        link.plug()


def test_ctrl_c_while_it_brakes_is_raised_and_nothing_is_sent_any_more() -> None:
    with machine(arm="1-2") as (made, sims):
        with Robot.of(made) as robot:
            cut = Cut(7)

            def leaves() -> None:
                with robot.loop(RATE) as loop:
                    loop.goal.update({"a1": 2.0, "a2": 2.0})
                    cycles(loop, 60)
                    sims["arm"].line = cut

            with pytest.raises(KeyboardInterrupt):
                leaves()
            robot.buses["arm"].link.advance(0.5)  # type: ignore[attr-defined]
            assert len(cut.sent) == 7
            assert robot["a1"].under_way  # so it is stopped when the machine is left
            with robot.loop(RATE) as again:
                again.goal["a1"] = 0.1
                assert cycles(again, 200).position["a1"] == pytest.approx(0.1, abs=0.02)
        assert not any(axis.under_way for axis in robot.axes.values())


def test_direct_goals_are_not_braked() -> None:
    with looping(arm="1", exit="leave", how={"direct": True}) as (_, loop, sims):
        loop.goal["a1"] = 0.0
        cycles(loop, 2)
        for number in range(10):
            loop.goal["a1"] = 0.01 * number
            cycles(loop, 1)
        sims["arm"].line = line = Heard()
        loop.__exit__(None, None, None)
        assert not line.sent


def test_what_goes_wrong_is_told_with_what_made_it_leave() -> None:
    axes = {"a1": {"max_step": "10 deg"}}
    with machine(arm="1-2", exit="leave", axes=axes) as (made, sims), Robot.of(made) as robot:

        def leaves() -> None:
            with robot.loop(RATE) as loop:
                loop.goal.update({"a1": 2.0, "a2": 2.0})
                cycles(loop, 60)
                here = sims["arm"][1].raw_position
                sims["arm"][1].blocked = (here - 30, here + 5)
                cycles(loop, 4)
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError) as left:
            leaves()
        assert "on leaving the loop: a1: the goal" in left.value.__notes__[0]


def test_a_stop_before_it_brakes_takes_that_axis_out_of_it_and_costs_the_others_no_cycle() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        with robot.loop(RATE) as loop:
            loop.goal.update({"a1": 2.0, "a2": 2.0})
            cycles(loop, 60)
            robot["a1"].stop()
            stood = robot["a1"].position()
            way = [place(loop, "a2").sent]
            memory = sims["arm"][2].memory
            sims["arm"].line = Each(lambda: way.append((memory["goal_position"] - 2048) * tau / 4096))
        assert robot["a1"].position() == pytest.approx(stood, abs=0.02)
        assert place(loop, "a2").arrived
        assert len(set(way)) > 20
        assert max(after - before for before, after in pairwise(way)) < 1.1 * QUICK / RATE


class Each(Heard):
    """A wire on which something is done with each frame."""

    def __init__(self, act: Any) -> None:
        super().__init__()
        self.act = act

    def carry(self, sender: Any, data: Any, at: float) -> Any:
        self.act()
        return super().carry(sender, data, at)
