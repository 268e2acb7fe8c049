"""Nobody says *stopped* who has not looked, three times and long enough."""

from __future__ import annotations

from enum import Enum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import Quality
from motorbus.core.operation import Operation
from motorbus.motion.safety.standstill import READS, SPAN, STILL, Rest, Standstill, Stopped, seen, stopped
from motorbus.motion.safety.track import Sample
from motorbus.session.robot import Robot
from tests.motion.machines import machine


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
        axis.bus.run(axis.able["move"](axis.device, 4.0, velocity=1.5, wait=False))
        axis.departs()
        found = axis.bus.run(stopped(axis))
        assert found.rest is Rest.STOPPED
        assert found.promise.name == "HOLD_ACCEPTED"
        assert found.position == pytest.approx(axis.position(), abs=0.002)


def test_what_goes_on_is_said_to_move() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.bus.run(axis.able["move"](axis.device, 4.0, velocity=0.5, wait=False))
        assert axis.bus.run(seen(axis, Promise.HOLD, patience=0.3)).rest is Rest.MOVING


def test_an_axis_that_is_silent_afterwards_was_not_seen_to_rest() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        axis = robot["a1"]
        inner = axis.able["stop"]

        def stops_and_is_unplugged(device: object) -> Operation[Enum]:
            promise: Enum = yield from inner(device)
            sims["arm"][1].unplug()
            return promise

        axis.able = {**axis.able, "stop": stops_and_is_unplugged}
        found = axis.bus.run(stopped(axis, patience=0.3))
        assert (found.rest, found.position) == (Rest.UNSEEN, None)


def test_an_axis_that_does_not_tell_where_it_is_is_never_said_to_have_stopped() -> None:
    with machine(lift=True) as (made, _), Robot.of(made) as robot:
        found = robot["lift"].bus.run(stopped(robot["lift"]))
        assert (found.promise.name, found.rest) == ("STOP_ACCEPTED", Rest.UNSEEN)


def test_it_says_both_what_was_seen_and_what_was_promised() -> None:
    assert str(Stopped(Promise.HOLD, Rest.STOPPED, 1.0)) == f"{Rest.STOPPED.value}; held"
