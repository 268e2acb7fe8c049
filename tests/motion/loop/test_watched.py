"""While axes are led, each is asked now and then how it fares, where there is time; a loop pays for it with nothing."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import Faulted, MotorbusError, Overloaded, Refused
from motorbus.motion.safety.restarts import HEALTH
from motorbus.motion.safety.watch import OVERDUE
from motorbus.session.robot import Robot
from tests.motion.loop.test_rounds import RATE, cycles, looping
from tests.safety.test_restarts import Drops
from tests.support.machines import Heard, machine


def polls(line: Heard) -> list[int]:
    """Whom the polls ask that were sent since this was asked last: each is a READ of one servo of its own."""
    found = [data[2] for data in line.sent if isinstance(data, bytes) and data[4] == 0x02]
    line.sent.clear()
    return found


def listening(sims: Any) -> Heard:
    sims["arm"].line = line = Heard()
    return line


def test_who_is_led_is_asked_four_times_a_second_one_at_a_time() -> None:
    with looping(arm="1-3") as (_, loop, sims):
        loop.goal.update({"a1": 0.1, "a2": 0.1})
        cycles(loop, 2)
        line = listening(sims)
        asked = []
        for _ in range(int(RATE)):
            next(loop)
            asked.append(polls(line))
        assert max(map(len, asked)) == 1
        counts = {node: sum(nodes == [node] for nodes in asked) for node in (1, 2, 3)}
        assert counts[3] == 0  # it is not led
        assert counts[1] in (3, 4)
        assert counts[2] in (3, 4)
        assert (loop.statistics.overruns, loop.statistics.skipped) == (0, 0)


def test_it_can_be_left_out() -> None:
    with looping(arm="1-2", how={"watch": False}) as (_, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.1))
        cycles(loop, 2)
        line = listening(sims)
        cycles(loop, int(RATE))
        assert polls(line) == []


def test_where_nobody_is_led_nobody_is_asked() -> None:
    with looping(arm="1-2") as (_, loop, sims):
        line = listening(sims)
        cycles(loop, int(RATE))
        assert polls(line) == []


def test_a_poll_goes_where_the_wire_is_free_and_no_cycle_begins_later_for_it() -> None:
    with looping(arm="1-2", rate=200.0) as (_, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.1))
        cycles(loop, 2)
        line = listening(sims)
        cycles(loop, 400)
        assert len(polls(line)) >= 12
        assert loop.statistics.lateness.most < 1e-6


def test_without_room_it_waits_until_it_is_overdue() -> None:
    with machine(arm="1-4", exit="leave") as (made, sims), Robot.of(made) as robot:
        rate = 0.995 / 640e-6  # 20 bytes of goals, 44 of questions and replies, at 1 Mbaud
        with robot.loop(rate) as loop:
            loop.goal.update(dict.fromkeys(loop.axes, 0.01))
            cycles(loop, 2)
            line = listening(sims)
            began = moment = loop._rounds.now
            asked: list[tuple[float, int]] = []
            while moment - began < 3.2 * OVERDUE * HEALTH:
                moment = next(loop).at
                asked += [(moment - began, node) for node in polls(line)]
            assert min(since for since, _ in asked) > (OVERDUE - 1) * HEALTH
            assert {node for _, node in asked} == {1, 2, 3, 4}
            assert len(asked) <= 4 * 4
            assert loop.statistics.overruns <= len(asked)


@pytest.mark.parametrize("name", ["a2", "c1"])
def test_a_device_that_restarts_is_a_fault_and_no_goal_of_it_leaves_any_more(name: str) -> None:
    speaks = {"can": {"boot_notice": True}}
    with looping(arm="1-2", can="0x21", exit="leave", options=speaks) as (_, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.5))
        cycles(loop, 60)
        device = sims["arm"][2] if name == "a2" else sims["can"][0x21]
        device.power_cycle()
        with pytest.raises(Faulted) as caught:
            cycles(loop, int(2 * HEALTH * RATE))
        assert name in str(caught.value)
        assert name not in loop.goal
        assert set(loop.goal) == {"a1", "a2", "c1"} - {name}
        written = device.memory["goal_position"]
        assert cycles(loop, 60).position["a1"] == pytest.approx(0.5, abs=0.02)  # the others can go on
        assert device.memory["goal_position"] == written
        loop.goal[name] = 0.1
        with pytest.raises(Refused) as refused:
            next(loop)
        assert refused.value.reason == "fault"
        assert device.memory["goal_position"] == written


def test_who_is_too_hot_is_told_to_stay_and_is_led_no_more() -> None:
    with looping(arm="1-2", exit="leave") as (_, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 2.0))
        cycles(loop, 60)
        sims["arm"][2].temperature = 68
        with pytest.raises(Overloaded, match="a2 .* is too hot") as caught:
            cycles(loop, int(2 * HEALTH * RATE))
        assert not getattr(caught.value, "__notes__", [])
        assert set(loop.goal) == {"a1"}
        assert sims["arm"][2].memory["torque_enable"] == 1  # what it holds might fall
        here = cycles(loop, 20).position["a2"]
        there = cycles(loop, 20).position
        assert there["a2"] == pytest.approx(here, abs=0.01)
        assert there["a1"] > there["a2"]


def test_what_watching_finds_while_leaving_keeps_nobody_from_braking() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        with robot.loop(RATE) as loop:
            loop.goal.update(dict.fromkeys(loop.axes, 2.0))
            cycles(loop, 60)
            sims["arm"][2].temperature = 68
        assert not robot["a1"].under_way


def test_a_silent_poll_is_forgiven() -> None:
    with looping(arm="1", exit="leave") as (_, loop, sims):
        loop.goal["a1"] = 0.1
        cycles(loop, 5)
        deaf = sims["arm"].line = Deaf()
        raised: list[MotorbusError] = []
        for _ in range(int(RATE)):
            try:
                next(loop)
            except MotorbusError as error:
                raised.append(error)
        assert deaf.dropped > 0
        assert not [error for error in raised if isinstance(error, Faulted | Overloaded)]


class Deaf(Heard):
    """Loses the polls, and nothing else."""

    dropped = 0

    def carry(self, sender: Any, data: Any, at: float) -> Any:
        found = super().carry(sender, data, at)
        if isinstance(data, bytes) and len(data) > 5 and data[4] == 0x02 and sender.name == "HOST":
            self.dropped += 1
            return []
        return found


def test_who_loses_his_supply_in_the_moment_he_is_given_torque_is_at_fault_and_not_called_stopped() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = Drops(sims["arm"][1].power_cycle)
        with robot.loop(100) as loop:
            loop.goal["a1"] = 0.2
            with pytest.raises(Faulted, match="a1 is at fault"):
                next(iter(loop))
        assert set(robot.faults) == {"a1"}
