"""Whom to ask next how he fares, how much of the wire that takes, and what his answer ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from random import Random
from typing import Any

import pytest

from motorbus.core.family import Health, State
from motorbus.core.operation import Data, Exchange, Operation, Pause, Together, outcome
from motorbus.errors import DeviceError, Faulted, MotorbusError, NoReply, Overloaded, Refused
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety.canary import HEALTH
from motorbus.motion.safety.strain import COOL, HOT, SECONDS
from motorbus.motion.safety.watch import OVERDUE, SHARE, Watch
from motorbus.session.robot import Robot
from tests.motion.machines import machine

EASY = Health(State(0.0, position=0.0, load=0.1, temperature=30.0), True, False)


class Then(PerfectLine):
    """A wire on which at a moment something happens."""

    def __init__(self, moment: float, happens: Callable[[], object]) -> None:
        self.moment, self.happens = moment, happens
        self.done = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if not self.done and at >= self.moment:
            self.done = True
            self.happens()
        return super().carry(sender, data, at)


@contextmanager
def watched(arm: str = "1-3", **every: Any) -> Iterator[tuple[Watch, Robot]]:
    """A watch that has begun over all axes of a bus, which have torque."""
    with machine(arm=arm, **every) as (made, _), Robot.of(made) as robot:
        robot.enable_torque()
        watch = Watch(robot.buses["arm"], robot.axes.values())
        robot["a1"].bus.run(watch.begin(robot.axes.values()))
        yield watch, robot


def now(robot: Robot) -> float:
    return robot.buses["arm"].link.now()


def whom(exchange: Exchange[Health]) -> int:
    assert isinstance(exchange.replies, tuple)
    return exchange.replies[0].node


# -- turns -------------------------------------------------------------------------------------------------------------


def test_each_is_asked_once_in_a_quarter_of_a_second_one_at_a_time() -> None:
    with watched() as (watch, robot):
        start = now(robot)
        asked: list[tuple[int, float]] = []
        for cycle in range(200):
            at = start + cycle * 0.01
            wanted = watch.due(at)
            if wanted is not None:
                asked.append((whom(wanted), at - start))
                watch.take(whom(wanted), EASY, {}, at)
        assert {node for node, _ in asked} == {1, 2, 3}
        for node in (1, 2, 3):
            moments = [at for who, at in asked if who == node]
            assert len(moments) >= 6
            apart = [later - at for at, later in pairwise(moments)]
            assert all(HEALTH - 1e-9 <= one < HEALTH + 0.05 for one in apart)


def test_what_was_due_and_not_asked_is_due_still() -> None:
    with watched() as (watch, robot):
        at = now(robot) + HEALTH
        first, again = watch.due(at), watch.due(at)
        assert first is not None
        assert again is not None
        assert first.request == again.request


def test_where_there_is_no_room_it_waits_until_it_is_overdue() -> None:
    with watched() as (watch, robot):
        start = now(robot)
        assert watch.due(start + HEALTH + 0.01, 0.0001) is None
        assert watch.due(start + HEALTH + 0.01, 0.01) is not None
        assert watch.due(start + OVERDUE * HEALTH + 0.01, 0.0) is not None


def test_on_a_slow_line_it_takes_a_tenth_of_the_wire_and_no_more() -> None:
    with watched() as (watch, robot):
        bus = robot.buses["arm"]
        bus.turns.rate = 9600
        start = now(robot) + 1.0
        spent = 0.0
        for cycle in range(1000):
            wanted = watch.due(start + cycle * 0.01)
            if wanted is not None:
                spent += bus.family.air_time(wanted, 9600)
                watch.take(whom(wanted), EASY, {}, start + cycle * 0.01)
        bus.turns.rate = 1_000_000
        assert 0.5 * SHARE < spent / 10.0 < 1.1 * SHARE


def test_who_does_not_tell_is_left_out_and_who_is_dismissed_is_not_asked() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        watch = Watch(robot.buses["stage"], robot.axes.values())
        robot["lift"].bus.run(watch.begin(robot.axes.values()))
        assert watch.due(1e9) is None
    with watched("1-2") as (watch, robot):
        watch.dismiss(1)
        watch.dismiss(1)
        wanted = watch.due(now(robot) + HEALTH)
        assert wanted is not None
        assert whom(wanted) == 2
        watch.dismiss(2)
        assert watch.due(now(robot) + 100.0) is None


@pytest.mark.parametrize(
    ("lost", "again"), [(NoReply("silent"), True), (DeviceError("it has none of that"), False)]
)
def test_an_answer_that_is_lost_is_forgiven_and_who_cannot_tell_is_left_out(
    lost: MotorbusError, again: bool
) -> None:
    with watched("1") as (watch, robot):
        at = now(robot) + HEALTH
        assert watch.due(at) is not None
        watch.take(1, lost, {}, at)
        assert watch.due(at) is None
        assert (watch.due(at + 2 * HEALTH) is not None) is again


# -- what an answer means ----------------------------------------------------------------------------------------------


def push(
    watch: Watch, start: float, times: int, places: Mapping[int, float] | None = None, **felt: Any
) -> None:
    """So often, a quarter of a second apart, servo 1 tells that it pushes hard; its goal is at 3.5 rad."""
    for number in range(1, times + 1):
        at = start + number * HEALTH
        watch.take(1, Health(State(at, load=0.95, **felt), True, False), {1: 3.5}, at, places or {})


def test_who_pushes_for_too_long_off_his_goal_is_overloaded_and_the_words_say_all() -> None:
    with watched("1") as (watch, robot):
        with pytest.raises(
            Overloaded, match=r"a1 \(arm#1\) has pushed too hard for 1\.0 s.*load 95%"
        ) as told:
            push(watch, now(robot), 20, position=3.0, temperature=40.0)
        assert told.value.reason == "load"
        assert told.value.node == 1
        assert f"less than {SECONDS:g} s of load 80% or 2.5 A" in told.value.expected
        assert "40 °C" in told.value.summary
        assert "keeps its torque" in told.value.advice


def test_a_place_that_was_heard_elsewhere_serves_a_device_whose_health_brings_none() -> None:
    with watched("1") as (watch, robot):
        push(watch, now(robot), 20)  # nobody knows where it is
        push(watch, now(robot) + 10.0, 4, {1: 3.0})
        with pytest.raises(Overloaded):
            push(watch, now(robot) + 11.0, 1, {1: 3.0})


def test_who_is_not_guarded_pushes_as_he_likes_and_is_at_fault_all_the_same() -> None:
    with watched("1", guard=False) as (watch, robot):
        at = now(robot) + 10.0
        push(watch, now(robot), 20, position=3.0, temperature=90.0)
        with pytest.raises(Faulted):
            watch.take(1, Health(State(at), False, True), {}, at)
        assert set(robot.faults) == {"a1"}
        assert watch.due(at + 100.0) is None


@pytest.mark.parametrize("limp", [1, 2])
@pytest.mark.parametrize("begun", [0, 2])
def test_each_is_judged_by_its_own_answer_also_where_two_are_asked_at_a_time(limp: int, begun: int) -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        bus, (first, second) = robot["a1"].bus, robot.axes.values()
        watch = Watch(bus, [first, second])
        bus.run(watch.begin([first, second]))
        bus.run(iter(Pause(2.0)))
        wanted = watch.due(now(robot))
        assert wanted is not None
        other = second if whom(wanted) == first.spec.node else first
        sims["arm"][limp].memory["torque_enable"] = 0

        def examined() -> Operation[None]:
            for _ in range(begun):  # then the other one has been asked by now
                yield from Pause(0)
            yield from watch.examine(other)

        bus.run(iter(Together([outcome(watch.asking()), outcome(examined())])))
        assert set(robot.faults) <= {f"a{limp}"}
        bus.run(iter(Pause(2.0)))
        bus.run(outcome(watch.asking()))  # whose turn came up meanwhile
        assert set(robot.faults) == {f"a{limp}"}


# -- while axes are led ------------------------------------------------------------------------------------------------


def test_a_motor_that_gets_too_hot_ends_the_movement_of_all_keeps_its_torque_and_must_cool() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        sim, bus = sims["arm"], robot.buses["arm"]

        def heat() -> None:
            sim[2].temperature = HOT + 1

        line = sim.line = Then(now(robot) + 0.6, heat)
        with pytest.raises(Overloaded, match=r"a2 \(arm#2\) is too hot: .*66 °C") as told:
            robot.move({"a1": 0.6, "a2": 0.6, "a3": -0.6}, duration=2.0)
        assert told.value.reason == "heat"
        assert now(robot) - line.moment < 2 * HEALTH
        assert all(sim[node].memory["torque_enable"] for node in (1, 2, 3))
        before = robot.positions()
        assert robot.positions() == before  # all stand
        assert robot.faults == {}
        with pytest.raises(Overloaded, match="too hot"):
            robot.move({"a2": 0.1})
        sim[2].temperature = COOL - 1
        robot.move({"a2": 0.1})
        assert bus.turns.latched is False


def test_who_is_too_hot_already_does_not_begin() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].temperature = HOT + 3
        with pytest.raises(Overloaded, match="too hot"):
            robot.move({"a1": 0.3, "a2": 0.3})
        assert robot.positions() == pytest.approx({"a1": 0.0, "a2": 0.0}, abs=0.002)


def test_a_blocked_motor_ends_the_movement_as_a_stall_or_as_an_overload_and_never_goes_unnoticed() -> None:
    with machine(arm="1-2", max_velocity="170 deg/s") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].blocked = (2000, 2100)
        with pytest.raises((Overloaded, MotorbusError), match="a1") as told:
            robot.move({"a1": 1.5, "a2": 1.5}, duration=4.0)
        assert type(told.value).__name__ in ("Stalled", "Overloaded")
        assert sims["arm"][1].memory["torque_enable"]


def test_the_switch_of_the_file_ends_that_watch_for_one_axis() -> None:
    with machine(arm="1-2", axes={"a1": {"guard": False}}) as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].temperature = HOT + 3
        robot.move({"a1": 0.3, "a2": 0.3})
        sims["arm"][2].temperature = HOT + 3
        with pytest.raises(Overloaded, match="a2"):
            robot.move({"a1": 0.0, "a2": 0.0})


def test_a_kst_servo_with_newer_firmware_is_watched_for_heat_too() -> None:
    options = {"can": {"profile": "kst-ext"}}
    with machine(can="0x25,0x26", options=options) as (made, sims), Robot.of(made) as robot:
        assert "health" in robot["c1"].able
        sims["can"][0x26].temperature = HOT + 3
        with pytest.raises(Overloaded, match="c2"):
            robot.move({"c1": 0.3, "c2": 0.3})


MODELS = ("sts3215", "scs0009", "scs215-2", "sm85blhv", "hls3925")


@pytest.mark.parametrize("model", MODELS)
def test_a_healthy_servo_that_moves_at_its_limits_never_trips(
    model: str, rounds: Callable[[int], int]
) -> None:
    chance = Random(model)
    options = {"arm": {"model": model}}
    wide = {"low": "-40 deg", "high": "40 deg", "zero": "110 deg"} if "scs" in model else {}
    fast = {"max_velocity": "300 deg/s", "max_acceleration": "3000 deg/s2"}
    made_of: dict[str, Any] = {**wide, **fast}
    with machine(arm="1-3", options=options, **made_of) as (made, _), Robot.of(made) as robot:
        for _ in range(rounds(100_000) // 2000):
            goals = {name: chance.uniform(-0.6, 0.6) for name in robot.axes}
            robot.move(goals, speed=chance.choice((1.0, 1.0, 0.5, 0.2)))
        assert robot.faults == {}


def test_a_healthy_kst_servo_that_moves_at_its_limits_never_trips(rounds: Callable[[int], int]) -> None:
    chance = Random(9)
    options = {"can": {"profile": "kst-ext", "boot_notice": True}}
    fast: dict[str, Any] = {"max_velocity": "300 deg/s", "max_acceleration": "3000 deg/s2"}
    with machine(can="0x25,0x26", options=options, **fast) as (made, _), Robot.of(made) as robot:
        for _ in range(rounds(100_000) // 2000):
            robot.move({name: chance.uniform(-0.6, 0.6) for name in robot.axes})
        assert robot.faults == {}


def test_a_fault_among_many_stops_the_others_and_none_of_them_is_at_fault() -> None:
    with machine(arm="1-6", can="0x25,0x26") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = Then(now(robot) + 0.5, lambda: sims["arm"][4].power_cycle())
        with pytest.raises(Faulted, match="a4"):
            robot.move(dict.fromkeys(robot.axes, 0.5), duration=2.0)
        assert set(robot.faults) == {"a4"}
        assert all(not axis.under_way for axis in robot.axes.values())
        with pytest.raises(Refused, match="a4"):
            robot.move(dict.fromkeys(robot.axes, 0.0))
        robot.move(dict.fromkeys([name for name in robot.axes if name != "a4"], 0.0))
