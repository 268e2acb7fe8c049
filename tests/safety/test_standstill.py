"""Nobody says *stopped* who has not looked, three times and long enough."""

from __future__ import annotations

import asyncio
import pkgutil
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from importlib import import_module

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus import families
from motorbus.core.family import Quality
from motorbus.core.request import Data
from motorbus.errors import MotorbusError
from motorbus.families.feetech.registers.rows import SCS_COUNT
from motorbus.link.base import Delivery, Side
from motorbus.motion.safety.standstill import READS, SPAN, STILL, Rest, Standstill, Stopped, seen, stopped
from motorbus.motion.safety.track import Sample
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import Heard, listened, machine, said


class Promise(Enum):
    HOLD = "held"


def judged(*samples: Sample) -> Standstill:
    judge = Standstill()
    for sample in samples:
        judge.take(sample)
    return judge


def fresh(*values: float, pause: float = SPAN / 2) -> list[Sample]:
    return [Sample(value, number * pause) for number, value in enumerate(values)]


def test_three_readings_at_one_place_prove_it_and_two_do_not() -> None:
    assert judged(*fresh(1.0, 1.0)).rest is Rest.UNSEEN
    assert judged(*fresh(1.0, 1.001, 1.0)).rest is Rest.STOPPED


def test_three_readings_in_no_time_prove_nothing() -> None:
    assert judged(*fresh(1.0, 1.0, 1.0, pause=0.001)).rest is Rest.UNSEEN


def test_one_elsewhere_begins_anew() -> None:
    assert judged(*fresh(1.0, 1.0, 1.1)).rest is Rest.MOVING
    assert judged(*fresh(1.0, 1.0, 1.1, 1.1)).rest is Rest.MOVING
    assert judged(*fresh(1.0, 1.0, 1.1, 1.1, 1.1)).rest is Rest.STOPPED


def test_a_count_of_the_coarsest_servo_is_rest_and_a_creep_is_not() -> None:
    assert judged(*fresh(1.0, 1.0 + SCS_COUNT, 1.0)).rest is Rest.STOPPED
    creep = 0.075 * SPAN  # rad; what is faster than 0.06 rad/s is seen
    assert judged(*fresh(1.0, 1.0 + creep / 2, 1.0 + creep)).rest is Rest.MOVING


@pytest.mark.parametrize("quality", [Quality.SUSPECT, Quality.REPEATED])
def test_what_cannot_be_believed_or_is_old_proves_nothing(quality: Quality) -> None:
    one, two, three = fresh(1.0, 1.0, 1.0)
    assert judged(one, two, three._replace(quality=quality)).rest is Rest.UNSEEN


def test_a_confirmed_reading_counts() -> None:
    one, two, three = fresh(1.0, 1.0, 1.0)
    assert judged(one, two, three._replace(quality=Quality.CONFIRMED)).rest is Rest.STOPPED


def test_a_reading_that_did_not_come_takes_back_what_was_seen() -> None:
    judge = judged(*fresh(1.0, 1.0, 1.0))
    assert judge.rests
    judge.lost()
    assert judge.rest is Rest.UNSEEN


@given(st.lists(st.tuples(st.floats(1e-3, 0.2), st.floats(-0.05, 0.05)), max_size=40))
def test_it_is_proven_exactly_when_enough_readings_in_a_row_are_at_one_place(
    steps: list[tuple[float, float]],
) -> None:
    at, place, row = 0.0, 0.0, [Sample(0.0, 0.0)]
    judge = judged(*row)
    for seconds, way in steps:
        at, place = at + seconds, place + way
        sample = Sample(place, at)
        row = [sample] if any(abs(one.value - place) > STILL for one in row) else [*row, sample]
        long = row[-1].at - row[0].at >= SPAN * (1 - 1e-9)
        assert judge.take(sample) == (len(row) >= READS and long)


# -- the operation -------------------------------------------------------------------------------------------------


def test_an_axis_that_moves_is_stopped_and_seen_to_rest() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.bus.run(axis.able.move(axis.device, 4.0, velocity=1.5, wait=False))
        axis.departs()
        found = axis.bus.run(stopped(axis))
        assert found.rest is Rest.STOPPED
        assert found.promise.name == "HOLD_ACCEPTED"
        assert found.position == pytest.approx(axis.position(), abs=0.002)


def test_what_goes_on_is_said_to_move() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.bus.run(axis.able.move(axis.device, 4.0, velocity=0.5, wait=False))
        assert axis.bus.run(seen(axis, Promise.HOLD, patience=0.3)).rest is Rest.MOVING


def test_an_axis_that_is_silent_afterwards_was_not_seen_to_rest() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        axis = robot["a1"]
        inner = axis.able.stop

        async def stops_and_is_unplugged(device: object) -> Enum:
            promise: Enum = await inner(device)
            sims["arm"][1].unplug()
            return promise

        axis.able = replace(axis.able, stop=stops_and_is_unplugged)
        found = axis.bus.run(stopped(axis, patience=0.3))
        assert (found.rest, found.position) == (Rest.UNSEEN, None)


def test_an_axis_that_does_not_tell_where_it_is_is_never_said_to_have_stopped() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        found = robot["lift"].bus.run(stopped(robot["lift"]))
        assert (found.promise.name, found.rest) == ("STOP_ACCEPTED", Rest.UNSEEN)


def test_it_says_both_what_was_seen_and_what_was_promised() -> None:
    assert str(Stopped(Promise.HOLD, Rest.STOPPED, 1.0)) == f"{Rest.STOPPED.value}; held"


def test_every_axis_is_told_to_stop_before_any_is_looked_at() -> None:
    with machine(arm="1-3", can="0x25", lift=True) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        listened(sims)
        found = robot.stopped()
        assert {name: one.rest for name, one in found.items()} == {
            **dict.fromkeys(("a1", "a2", "a3", "c1"), Rest.STOPPED),
            "lift": Rest.UNSEEN,
        }
        frames = sims["arm"].line.sent  # type: ignore[attr-defined]
        goals = [place for place, data in enumerate(frames) if data[4] == 3]
        looks = [
            place for place, data in enumerate(frames) if data[4] == 2 and data[5] == 56 and data[6] == 2
        ]
        last = {node: max(place for place in goals if frames[place][2] == node) for node in (1, 2, 3)}
        assert sum(place > max(last.values()) for place in looks) >= 3 * 3, "each was looked at afterwards"


def test_on_an_event_loop_it_is_the_same() -> None:
    async def main() -> None:
        with machine(arm="1-2", lift=True) as (made, _):
            async with AsyncRobot.of(made) as robot:
                await robot.enable_torque()
                found = await robot.stopped()
                assert [one.rest for one in found.values()] == [Rest.STOPPED, Rest.STOPPED, Rest.UNSEEN]
                assert (await robot["a1"].stopped()).rest is Rest.STOPPED

    asyncio.run(main())


def test_who_does_not_accept_it_is_an_error_and_the_others_are_looked_at() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].unplug()
        listened(sims)
        with pytest.raises(MotorbusError, match="a1"):
            robot.stopped()
        assert sum("servo 2" in frame for frame in said(sims)) >= READS
        assert sum("node 37" in frame for frame in said(sims)) >= READS


def test_what_goes_on_by_itself_is_told_as_moving_by_the_verb_of_the_robot() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        moved = iter(range(10_000))
        sims["arm"].line = Pushed(lambda: setattr(sims["arm"][2], "raw_position", 2048 + 20 * next(moved)))
        found = robot.stopped(patience=0.3)
        assert (found["a1"].rest, found["a2"].rest) == (Rest.STOPPED, Rest.MOVING)


class Pushed(Heard):
    """A wire; while it carries something, something else happens."""

    def __init__(self, act: Callable[[], object]) -> None:
        super().__init__()
        self.act = act

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        self.act()
        return super().carry(sender, data, at)


# -- nobody else says so -------------------------------------------------------------------------------------------

CAREFUL = (
    "standstill was not verified",
    "nothing tells",
    "limp",
    "nothing was sent",
    "runs out without holding",
)


@pytest.mark.parametrize("family", ["feetech", "kst", "stepper"])
def test_no_promise_of_a_device_claims_that_it_rests(family: str) -> None:
    found = {
        one
        for module in pkgutil.walk_packages(
            import_module(f"motorbus.families.{family}").__path__, f"motorbus.families.{family}."
        )
        for one in vars(import_module(module.name)).values()
        if isinstance(one, type) and issubclass(one, Enum) and one.__name__ == "Promise"
    }
    assert found
    for promise in (one for kind in found for one in kind):
        assert promise.name != "STOPPED"
        assert any(words in promise.value or "torque off ends" in promise.value for words in CAREFUL), promise
    said_ = families.load(family).open().stop({1: None}).promise
    assert any(words in said_ for words in CAREFUL)
