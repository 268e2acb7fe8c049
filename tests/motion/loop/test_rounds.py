"""What a loop does, on simulated buses in virtual time: nothing unasked, all on its grid, and every stop heeded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import inf, nan, radians
from typing import Any

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import Interrupted, LimitExceeded, LinkLost, MotorbusError, NoReply, RequestError
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.loop.faces import Loop
from motorbus.motion.loop.readings import PATIENCE, SILENCE, LoopState
from motorbus.session.robot import Robot
from tests.support.machines import Heard, machine

RATE = 100.0


class Slow(PerfectLine):
    """Whatever the devices say comes so much later (s); `0` nothing."""

    def __init__(self) -> None:
        self.by = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        other = Side.DEVICE if sender is Side.HOST else Side.HOST
        return [Delivery(at + (self.by if other is Side.HOST else 0.0), other, data)]


@contextmanager
def looping(
    rate: float = RATE, how: dict[str, Any] | None = None, **made: Any
) -> Iterator[tuple[Robot, Loop, Any]]:
    with machine(**made) as (found, sims), Robot.of(found) as robot, robot.loop(rate, **(how or {})) as loop:
        yield robot, loop, sims


def cycles(loop: Loop, count: int, each: Callable[[Any], None] = lambda state: None) -> Any:
    """So many; gives the last state."""
    state = None
    for _ in range(count):
        state = next(loop)
        each(state)
    return state


# -- nothing unasked ---------------------------------------------------------------------------------------------


def test_entering_and_looking_write_nothing() -> None:
    with machine(arm="1-3", can="0x21") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line, sims["can"].line = lines = Heard(), Heard()
        with robot.loop(RATE) as loop:
            assert cycles(loop, 5).number == 4
        assert {data[4] for data in lines[0].sent if isinstance(data, bytes)} <= {
            0x02,
            0x82,
        }  # READ and SYNC READ
        assert {data.data[0] for data in lines[1].sent if isinstance(data, CanFrame)} == {
            0x40
        }  # uploads: nothing is written
        assert not robot["a1"].engaged


def test_only_who_gets_a_goal_gets_torque_and_that_in_a_cycle_of_its_own() -> None:
    with looping(arm="1-3") as (robot, loop, sims):
        cycles(loop, 3)
        loop.goal["a2"] = 0.1
        state = cycles(loop, 1)
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2, 3)] == [0, 1, 0]
        assert [robot[name].engaged for name in ("a1", "a2", "a3")] == [False, True, False]
        assert loop.statistics.begun == 1
        assert (loop.statistics.overruns, loop.statistics.skipped) == (0, 0)
        assert state.position["a2"] == pytest.approx(0.0, abs=0.01)  # it does not jump


def test_torque_takes_slots_that_nobody_is_blamed_for() -> None:
    with looping(arm="1-6", rate=400.0) as (_, loop, sims):
        cycles(loop, 3)
        sims["arm"].line = slow = Slow()
        slow.by = 0.002
        loop.goal.update(dict.fromkeys(loop.axes, 0.1))
        assert cycles(loop, 1).number > 10
        slow.by = 0.0
        assert (loop.statistics.overruns, loop.statistics.skipped, loop.statistics.begun) == (0, 0, 1)


# -- the grid ------------------------------------------------------------------------------------------------------


def test_cycles_are_a_period_apart_on_all_buses() -> None:
    with looping(arm="1-2", can="0x21-0x22") as (_, loop, _sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.1))
        first = cycles(loop, 2)
        last = cycles(loop, 200)
        assert last.number - first.number == 200
        assert last.at - first.at == pytest.approx(2.0, abs=0.002)
        assert loop.statistics.overruns == 0
        assert set(loop.statistics.buses) == {"arm", "can"}
        assert loop.statistics.cycle.most < 1 / RATE


def test_a_bus_that_is_too_slow_overruns_and_nothing_is_stretched() -> None:
    with looping(arm="1-2", rate=200.0) as (_, loop, sims):
        sims["arm"].line = slow = Slow()
        first = cycles(loop, 1)
        slow.by = 0.012  # a cycle takes more than two periods
        cycles(loop, 1)
        slow.by = 0.0
        last = cycles(loop, 5)
        told = loop.statistics
        assert (told.overruns, told.skipped) == (1, 1)
        assert last.number - first.number == 7
        assert last.at - first.at == pytest.approx(7 / 200, abs=0.001)
        assert told.cycle.most == pytest.approx(0.012, abs=0.001)
        assert told.lateness.most > 0.002


def test_a_body_that_is_too_slow_overruns_too() -> None:
    with looping(arm="1-2") as (robot, loop, _):
        numbers = []

        def slow(state: Any) -> None:
            numbers.append(state.number)
            if state.number == 3:
                robot.buses["arm"].link.advance(0.034)  # type: ignore[attr-defined]

        cycles(loop, 7, slow)
        assert numbers == [0, 1, 2, 3, 6, 7, 8]
        assert (loop.statistics.overruns, loop.statistics.skipped) == (1, 2)


def test_a_movement_makes_a_short_hitch_good() -> None:
    with looping(arm="1") as (robot, loop, _):
        loop.goal["a1"] = 2.0
        cycles(loop, 80)
        robot.buses["arm"].link.advance(0.024)  # type: ignore[attr-defined]
        cycles(loop, 1)
        place = loop._rounds.places["a1"]
        before = place.sent
        cycles(loop, 1)
        assert place.sent - before == pytest.approx(radians(90) / RATE, rel=1e-6)  # type: ignore[operator]


# -- who is silent ---------------------------------------------------------------------------------------------------


def test_a_missing_reading_is_told_with_the_last_one_and_its_age() -> None:
    with looping(arm="1-3") as (_, loop, sims):
        before = cycles(loop, 2)
        assert before.age == {"a1": 0.0, "a2": 0.0, "a3": 0.0}
        sims["arm"][2].unplug()
        state = cycles(loop, 1)
        assert state.missing == {"a2"}
        assert state.position["a2"] == before.position["a2"]
        assert state.age["a2"] == pytest.approx(state.at - before.at, abs=0.001)
        assert state.age["a1"] == 0.0
        assert loop.statistics.lost == {"a1": 0, "a2": 1, "a3": 0}
        sims["arm"][2].plug()
        assert not cycles(loop, 20).missing


def test_who_is_silent_too_long_ends_it_by_name() -> None:
    with looping(arm="1-3") as (_, loop, sims):
        before = cycles(loop, 2)
        sims["arm"][2].unplug()
        states: list[LoopState] = []
        with pytest.raises(NoReply, match="a2: no reading in "):
            states.extend(next(loop) for _ in range(100))
        assert len(states) >= PATIENCE
        assert states[-1].at - before.at == pytest.approx(SILENCE, abs=3 / RATE)
        slots = states[-1].number - before.number
        assert slots > len(states)  # to wait in vain takes longer than a cycle, so time counts
        sims["arm"][2].plug()
        with suppress(NoReply):  # who was silent for long is left alone by the bus for as long
            cycles(loop, 80)
        assert not cycles(loop, 20).missing  # it can go on


def test_six_cycles_of_silence_are_needed_however_long_they_last() -> None:
    with looping(rate=5.0, arm="1-3") as (_, loop, sims):
        before = cycles(loop, 2)
        sims["arm"][2].unplug()
        late = cycles(loop, PATIENCE)
        assert late.at - before.at > 3 * SILENCE
        with pytest.raises(NoReply, match=f"a2: no reading in {PATIENCE + 1} cycles"):
            next(loop)


def test_who_is_silent_from_the_beginning_is_refused() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        for match in ("a2: node 2 did not answer", "a2: (no reading|node 2 did not answer)"):
            sims["arm"][2].unplug()
            with pytest.raises(NoReply, match=match), robot.loop(RATE):
                raise AssertionError("entered")
            sims["arm"][2].plug()
            robot.positions()  # its settings are known now


# -- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direct", [False, True])
def test_a_refused_goal_sends_nothing_and_the_loop_goes_on(direct: bool) -> None:
    with looping(arm="1-2", how={"direct": direct}) as (_, loop, sims):
        loop.goal.update({"a1": 0.01, "a2": 0.01})
        before = cycles(loop, 3)
        sims["arm"].line = line = Heard()
        loop.goal.update({"a1": 0.015, "a2": 9.0})
        with pytest.raises(LimitExceeded, match="a2: the goal 515.7 deg is outside"):
            next(loop)
        assert not line.sent
        assert loop.goal["a2"] == 0.01
        assert cycles(loop, 3).number == before.number + 3


def test_a_direct_goal_that_is_too_far_is_refused() -> None:
    with looping(arm="1", how={"direct": True}) as (_, loop, _sims):
        loop.goal["a1"] = 0.0
        cycles(loop, 2)
        loop.goal["a1"] = 0.1
        with pytest.raises(LimitExceeded, match="its limit is 90 deg/s"):
            next(loop)
        loop.goal["a1"] = 0.012
        cycles(loop, 30)
        assert cycles(loop, 1).position["a1"] == pytest.approx(0.012, abs=0.003)


@pytest.mark.parametrize("rate", [0.0, -1.0, nan, inf, "x", True, 1e-9, pytest.param(10**400, id="10**400")])
def test_a_rate_is_a_number_above_nothing(rate: float) -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot, pytest.raises(RequestError, match="rate is"):
        robot.loop(rate)


def test_what_cannot_be_in_a_loop_is_named_or_refused() -> None:
    with looping(arm="1", lift=True) as (robot, loop, _):
        assert (loop.axes, loop.without) == (("a1",), ("lift",))
        with pytest.raises(RequestError, match="lift cannot be led"):
            loop.goal["lift"] = 0.0
        with pytest.raises(RequestError, match="elbow is not in this loop"):
            loop.goal["elbow"] = 0.0
        for goal in ("0.1", None, True):
            with pytest.raises(RequestError, match="the goal of a1 is"):
                loop.goal["a1"] = goal  # type: ignore[assignment]
        loop.goal["a1"] = 0
        assert loop.goal["a1"] == 0.0
        with pytest.raises(RequestError, match="none of these axes"):
            robot.loop(RATE, "lift")


# -- stopped, and left -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["stop", "disable_torque", "hold"])
@pytest.mark.parametrize("name", ["a1", "c1"])
def test_who_is_stopped_from_elsewhere_gets_no_goal_any_more(how: str, name: str) -> None:
    with looping(arm="1-2", can="0x21") as (robot, loop, _sims):
        if name == "c1" and how == "disable_torque":
            assert not hasattr(robot["c1"], how)
            return
        loop.goal.update(dict.fromkeys(loop.axes, 0.8))
        cycles(loop, 30)
        getattr(robot[name], how)()
        with pytest.raises(Interrupted, match=f"{name}: stopped from elsewhere"):
            next(loop)
        assert name not in loop.goal
        here = cycles(loop, 5).position
        there = cycles(loop, 30).position
        assert there[name] == pytest.approx(here[name], abs=0.03)
        assert there["a2"] > here["a2"] + 0.2  # the others go on when the loop does
        loop.goal[name] = 0.8
        assert cycles(loop, 120).position[name] == pytest.approx(0.8, abs=0.02)


def test_an_emergency_stop_in_the_middle_is_the_end_of_all_goals() -> None:
    with looping(arm="1-2", exit="leave") as (robot, loop, sims):
        loop.goal.update({"a1": 0.8, "a2": 0.8})
        cycles(loop, 30)
        robot.estop()
        written = sims["arm"][1].memory["goal_position"]
        with pytest.raises(Interrupted):
            next(loop)
        assert not dict(loop.goal)
        cycles(loop, 5)
        loop.goal["a1"] = 0.8
        with pytest.raises(Interrupted):
            next(loop)
        assert sims["arm"][1].memory["goal_position"] == written
        assert sims["arm"][1].memory["torque_enable"] == 0


# -- while nothing can be sent -----------------------------------------------------------------------------------------


def gone(loop: Loop, name: str) -> float:
    """How far (rad) the small goals of an axis go in 30 cycles that all raise."""
    place: Any = loop._rounds.places[name]
    before = place.sent
    for _ in range(30):
        with pytest.raises(MotorbusError):
            next(loop)
    way: float = place.sent - before
    return way


def test_no_goal_of_before_is_given_when_a_port_that_was_gone_is_there_again() -> None:
    with machine(arm="1", can="0x21", exit="leave") as (made, sims), Robot.of(made) as robot:
        link: Any = robot.buses["arm"].link
        with robot.loop(RATE) as loop:
            loop.goal.update({"a1": 2.0, "c1": 0.7})
            cycles(loop, 40)
            link.unplug()
            for _ in range(30):
                with pytest.raises(MotorbusError):
                    next(loop)
            link.plug()
            here, sims["arm"].line = robot["a1"].position(), Heard()
            state = cycles(loop, 100)
            assert not ordered(sims["arm"].line)
            assert state.position["a1"] == pytest.approx(here, abs=0.02)
            assert state.position["c1"] == pytest.approx(0.7, abs=0.02), "the other bus goes on"
            loop.goal["a1"] = 2.0
            assert cycles(loop, 150).position["a1"] == pytest.approx(2.0, abs=0.02)


def test_a_loop_is_told_of_a_loss_that_somebody_else_saw_and_gives_no_goal_of_before() -> None:
    with machine(arm="1-2", can="0x21", exit="leave") as (made, sims), Robot.of(made) as robot:
        link: Any = robot.buses["arm"].link
        with robot.loop(RATE, axes=["a1"]) as loop:
            loop.goal["a1"] = 2.0
            cycles(loop, 10)
            link.unplug()
            with pytest.raises(LinkLost):
                robot["a2"].position()
            link.plug()
            robot["a2"].position()
            sims["arm"].line = Heard()
            with pytest.raises(LinkLost, match="after this procedure began"):
                next(loop)
            cycles(loop, 10)
            assert not ordered(sims["arm"].line)
            loop.goal["a1"] = 1.0
            assert cycles(loop, 150).position["a1"] == pytest.approx(1.0, abs=0.02)


def ordered(line: Any) -> list[bytes]:
    """What of that writes to a servo."""
    return [data for data in line.sent if isinstance(data, bytes) and data[4] in (0x03, 0x83)]


def test_no_small_goal_runs_away_while_the_settings_of_another_servo_are_not_known() -> None:
    with looping(arm="1", can="0x21") as (robot, loop, _):
        loop.goal.update({"a1": 2.0, "c1": 0.7})
        cycles(loop, 30)
        servo: Any = robot["c1"].device
        known, servo.limits = servo.limits, (-1.0, 1.0)  # as after a write to one of them
        assert 0 <= gone(loop, "a1") < 2 * radians(90) / RATE
        servo.limits = known
        assert cycles(loop, 150).position == pytest.approx({"a1": 2.0, "c1": 0.7}, abs=0.02)


def test_a_loop_that_is_too_slow_to_lead_only_looks() -> None:
    with looping(arm="1-2", rate=3.9) as (_, loop, sims):
        with pytest.raises(RequestError, match="only looks") as refused:
            loop.goal["a1"] = 0.5
        assert "4 Hz or more" in str(refused.value)
        assert not cycles(loop, 2).missing
        assert sims["arm"][1].memory["torque_enable"] == 0
    with looping(arm="1-2", rate=4.0) as (_, loop, sims):
        loop.goal["a1"] = 0.1
        cycles(loop, 8)
        assert sims["arm"][1].memory["torque_enable"] == 1
