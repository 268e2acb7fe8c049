"""A loop that is a cycle ahead: what leaves and when, and that nothing is ordered that another loop would not order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians
from typing import Any

import pytest

from motorbus.core.operation import Data
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, RequestError
from motorbus.link.base import Delivery, Side
from motorbus.motion.loop.faces import Loop
from motorbus.motion.safety.lease import Lease
from motorbus.session.robot import Robot
from tests.motion.loop.lines import Doubtful
from tests.motion.loop.test_rounds import RATE, Slow, cycles, looping
from tests.motion.machines import Heard, machine

AHEAD = {"ahead": True, "watch": False}


@contextmanager
def ahead(**made: Any) -> Iterator[tuple[Robot, Loop, Any]]:
    """A loop that is ahead, on a line that keeps what was sent and can be made to fail."""
    how = {**AHEAD, **made.pop("how", {})}
    with looping(how=how, **{"arm": "1-3", "exit": "leave", **made}) as (robot, loop, sims):
        sims["arm"].line = Doubtful()
        yield robot, loop, sims


def goals(line: Any, node: int = 1) -> list[int]:
    """The raw goals that one was sent since this was asked last."""
    return [packet[node] for packet in packets(line) if node in packet]


def packets(line: Any) -> list[dict[int, int]]:
    """The raw goals of each packet of goals, by node; behind it there may be the question that left with it."""
    found = []
    for data in line.sent:
        if data[4] == 0x83:  # SYNC WRITE: a head of 7 bytes, then id and goal of each
            size, blocks = data[6] + 1, data[7 : 3 + data[3]]
            starts = range(0, len(blocks), size)
            found.append({blocks[at]: int.from_bytes(blocks[at + 1 : at + 3], "little") for at in starts})
    line.sent.clear()
    return found


# -- when what leaves ------------------------------------------------------------------------------------------------


def test_the_next_cycle_has_left_when_one_is_told() -> None:
    with ahead() as (_, loop, sims):
        line = sims["arm"].line
        first = next(loop)
        assert len(line.sent) == 2  # the cycle that is told, and the next one
        for number in range(1, 5):
            assert next(loop).number == first.number + number
            assert len(line.sent) == number + 2


@pytest.mark.parametrize("cycle", [1, 2])
def test_a_goal_leaves_with_the_cycle_after_the_next_one(cycle: int) -> None:
    """How many packets of goals have left when a slot is told, and which of them has the goal that was set then."""
    with ahead(how={"direct": True, "ahead": cycle == 2}) as (_, loop, sims):
        line, known = sims["arm"].line, list[int]()
        loop.goal.update(dict.fromkeys(loop.axes, 0.0))
        first = next(loop).number
        known += goals(line)
        for number in range(1, 7):
            loop.goal["a1"] = 0.01 * number
            assert next(loop).number == first + number
            known += goals(line)
        steps = [round((goal - known[0]) * radians(360) / 4096 / 0.01) for goal in known]
        assert steps == [0] * cycle + [
            1,
            2,
            3,
            4,
            5,
            6,
        ]  # that of slot `first` was told is with the one `cycle` later


def test_it_goes_where_another_loop_goes() -> None:
    there = []
    for how in ({"ahead": True}, {"ahead": False}):
        with ahead(how=how) as (_, loop, sims):
            loop.goal["a1"] = 0.5
            cycles(loop, 20)
            loop.goal["a2"] = -0.3
            cycles(loop, 150)
            given = goals(sims["arm"].line), goals(sims["arm"].line, 2)
            there.append((loop.goal, given[0][-1:], given[1][-1:], cycles(loop, 1).position))
            assert loop.statistics.begun == 2
            assert (loop.statistics.overruns, loop.statistics.skipped) == (0, 0)
    assert there[0][1:3] == there[1][1:3]
    assert there[0][3] == pytest.approx(there[1][3], abs=0.001)


def test_entering_and_looking_write_nothing() -> None:
    with ahead() as (robot, loop, sims):
        cycles(loop, 5)
        assert {data[4] for data in sims["arm"].line.sent} == {0x82}  # SYNC READ
        assert not robot["a1"].engaged


def test_the_grid_is_kept_and_a_hitch_is_made_good() -> None:
    with ahead() as (robot, loop, _):
        loop.goal["a1"] = 2.0
        first = cycles(loop, 80)
        place = loop._rounds.places["a1"]
        before, periods = place.sent, loop._rounds._stepped
        robot.buses["arm"].link.advance(0.024)  # type: ignore[attr-defined]
        last = cycles(loop, 4)
        assert (
            last.number - first.number == 5
        )  # the one in the air, one that is late in its slot, and two in time
        assert last.at - first.at == pytest.approx(5 / RATE, abs=0.001)
        assert (loop.statistics.overruns, loop.statistics.skipped) == (1, 1)
        periods = loop._rounds._stepped - periods
        assert place.sent - before == pytest.approx(periods * radians(90) / RATE, rel=1e-6)  # type: ignore[operator]


def test_a_bus_that_is_too_slow_is_not_waited_for_and_its_next_goals_leave_right_behind_the_answer() -> None:
    with ahead(how={"direct": True}, rate=1000.0, arm="1-2") as (_, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.0))
        cycles(loop, 3)
        sims["arm"].line = slow = Slow()
        slow.by = 0.0012
        before = loop.statistics.cycles, loop.statistics.skipped
        first = cycles(loop, 2)
        last = cycles(loop, 40)
        took = (last.at - first.at) / 40
        assert loop.statistics.cycles == before[0] + 42
        assert 0.0012 < took < 0.0018
        assert loop.statistics.overruns >= 40
        assert last.number - first.number == pytest.approx(40 * took * 1000, abs=3)


# -- what is not ordered -----------------------------------------------------------------------------------------------


class Behind(Doubtful):
    """Answers come so late (s) that the next slot has begun by then."""

    by = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return super().carry(sender, data, at + (self.by if sender is Side.DEVICE else 0.0))


@pytest.mark.parametrize("direct", [False, True])
def test_a_refused_goal_is_not_sent_and_the_loop_goes_on(direct: bool) -> None:
    with ahead(how={"direct": direct}) as (_, loop, sims):
        loop.goal.update({"a1": 0.01, "a2": 0.01})
        before = cycles(loop, 3)
        goals(sims["arm"].line)
        loop.goal.update({"a1": 0.015, "a2": 9.0})
        with pytest.raises(LimitExceeded, match="a2: the goal 515.7 deg is outside"):
            next(loop)
        assert not sims["arm"].line.sent
        assert loop.goal["a2"] == 0.01
        assert cycles(loop, 3).number == before.number + 3


def test_who_is_held_back_stays_and_the_others_go_on() -> None:
    with ahead(axes={"a1": {"max_step": "10 deg"}}) as (_, loop, sims):
        loop.goal.update({"a1": 2.0, "a2": 2.0})
        cycles(loop, 60)
        here = sims["arm"][1].raw_position
        sims["arm"][1].blocked = (here - 30, here + 5)
        with pytest.raises(LimitExceeded, match="a1: the goal"):
            cycles(loop, 30)
        goals(sims["arm"].line)
        cycles(loop, 80)
        assert len(set(goals(sims["arm"].line))) == 1
        assert loop._rounds.places["a2"].position == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("how", ["stop", "disable_torque", "hold"])
def test_who_is_stopped_from_elsewhere_gets_no_goal_any_more(how: str) -> None:
    with ahead() as (robot, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.8))
        cycles(loop, 30)
        getattr(robot["a1"], how)()
        line = sims["arm"].line
        goals(line)
        with pytest.raises(Interrupted, match="a1: stopped from elsewhere"):
            next(loop)
        here = cycles(loop, 5).position
        there = cycles(loop, 30).position
        assert not goals(line)
        assert there["a1"] == pytest.approx(here["a1"], abs=0.03)
        assert there["a2"] > here["a2"] + 0.2
        loop.goal["a1"] = 0.8
        assert cycles(loop, 120).position["a1"] == pytest.approx(0.8, abs=0.02)


def test_who_is_stopped_when_goals_are_ready_does_not_get_them() -> None:
    with ahead() as (robot, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.8))
        cycles(loop, 30)
        rounds: Any = loop._rounds
        landed = rounds._landed

        def stopped(*given: Any) -> Any:
            rounds._landed = landed
            robot["a1"].stop()  # the next goals have been judged, and have not left
            goals(sims["arm"].line)
            return landed(*given)

        rounds._landed = stopped
        assert next(loop).missing == frozenset()
        assert not goals(sims["arm"].line)
        with pytest.raises(Interrupted, match="a1: stopped from elsewhere"):
            next(loop)
        assert not goals(sims["arm"].line)


def test_an_emergency_stop_is_the_end_of_all_goals() -> None:
    with ahead() as (robot, loop, sims):
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


def test_a_port_that_is_gone_is_told_and_no_goal_of_before_is_given_when_it_is_there_again() -> None:
    with ahead(arm="1") as (robot, loop, sims):
        link: Any = robot.buses["arm"].link
        loop.goal["a1"] = 2.0
        cycles(loop, 40)
        link.unplug()
        for _ in range(10):
            with pytest.raises(MotorbusError):
                next(loop)
        link.plug()
        sims["arm"].line = line = Heard()
        cycles(loop, 30)
        assert not goals(line)


def test_no_goal_leaves_when_its_lease_is_over_also_where_it_was_judged_before() -> None:
    with ahead(how={"direct": True}, rate=200.0) as (robot, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.0))
        cycles(loop, 3)
        sims["arm"].line = line = Behind()
        line.by = 0.006
        cycles(loop, 3)
        gate: Any = robot.buses["arm"].admit
        lease = gate.lease = Lease(0.5)
        lease.take("somebody", robot.now)
        packets(line)
        left = list[float]()
        carry = line.carry

        def carried(sender: Side, data: Data, at: float) -> list[Delivery]:
            if sender is Side.HOST and isinstance(data, bytes) and data[4] == 0x83:
                left.append(robot.now)
            return carry(sender, data, at)

        line.carry = carried  # type: ignore[method-assign]
        with pytest.raises(MotorbusError):
            cycles(loop, 300)
        assert len(left) > 50
        assert left[-1] <= lease._until


# -- leaving, and where it cannot be -----------------------------------------------------------------------------------


def test_when_it_is_left_what_is_in_the_air_comes_down_and_who_is_on_his_way_brakes() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        with robot.loop(RATE, ahead=True) as loop:
            loop.goal["a1"] = 2.0
            cycles(loop, 60)
            speed = abs(sims["arm"][1].memory["present_velocity"])
        assert speed > 0
        place = robot["a1"].position()
        robot.buses["arm"].link.advance(0.5)  # type: ignore[attr-defined]
        assert robot["a1"].position() == pytest.approx(place, abs=0.02)
        assert robot.buses["arm"].turns.idle
        with pytest.raises(RequestError, match="the loop was left"):
            next(loop)


def test_ctrl_c_in_its_body_leaves_nothing_in_the_air() -> None:
    with machine(arm="1-2", exit="leave") as (made, _), Robot.of(made) as robot:

        def interrupted() -> None:
            with robot.loop(RATE, ahead=True) as loop:
                loop.goal["a1"] = 1.0
                cycles(loop, 10)
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert robot.buses["arm"].turns.idle
        assert robot["a1"].position() is not None


@pytest.mark.parametrize("how", ["estop", "stop"])
def test_after_a_stop_in_its_body_it_is_left_in_silence(how: str) -> None:
    with machine(arm="1-2", exit="leave") as (made, _), Robot.of(made) as robot:
        with robot.loop(RATE, ahead=True) as loop:
            loop.goal["a1"] = 2.0
            cycles(loop, 40)
            getattr(robot if how == "estop" else robot["a1"], how)()
        assert not robot.buses["arm"].turns.flying


@pytest.mark.parametrize(
    ("made", "cause"),
    [
        ({"arm": "1-2", "can": "0x21"}, "these are on arm, can: each bus waits for itself"),
        ({"can": "0x21-0x22"}, "these are on can: there the answers of several are awaited at once"),
    ],
)
def test_it_is_refused_where_nothing_can_be_halved(made: dict[str, str], cause: str) -> None:
    with machine(**made) as (found, _), Robot.of(found) as robot:  # type: ignore[arg-type]
        refused = robot.loop(RATE, ahead=True)
        with pytest.raises(RequestError, match=cause):
            refused.__enter__()
        with pytest.raises(RequestError, match="the loop was left"):
            refused.goal[refused.axes[0]] = 0.5
        with robot.loop(RATE) as loop:
            next(loop)
