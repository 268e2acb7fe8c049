"""Standing still on demand: what each mode is told, by the mode of this moment, and who is better left alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.request import Priority
from motorbus.core.steps import Sleep
from motorbus.errors import RequestError, VerificationFailed
from motorbus.families.feetech import Servo
from motorbus.families.feetech.driver import Node, Promise, move, stop
from motorbus.families.feetech.driver.motion import OLD, SLEPT
from motorbus.families.feetech.table import CONTROL, TABLES, Mode
from tests.families.feetech.driver_script import (
    Line,
    Played,
    low_high,
    play,
    prepared,
    prepares,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import simulated

IS_ON = reads(3, 40, 1)


def stands(raw: int) -> Line:
    return reads(3, 56, *low_high(raw))


def test_stop_holds_where_the_servo_is_and_promises_no_more() -> None:
    wish = stop(prepared())
    played = watch(wish, prepares(), stands(777), writes(3, 42, *low_high(777)))
    assert played.requests[2].priority is Priority.CONTROL
    hold = play(stop(prepared()), prepares(), stands(777), writes(3, 42, *low_high(777)))
    assert hold is Promise.HOLD_ACCEPTED
    assert "not verified" in Promise.HOLD_ACCEPTED.value


def test_stop_is_not_refused_for_standing_outside_the_limits_with_torque() -> None:
    played = Played([prepares(at_12=0), stands(900), IS_ON, writes(3, 42, *low_high(900))])
    assert played.run(stop(prepared(at_12=0))) is Promise.OUTSIDE_ACCEPTED
    (goal,) = played.requests[3].setpoints
    assert goal.low == goal.value == goal.high
    assert "only torque off ends that" in Promise.OUTSIDE_ACCEPTED.value


@pytest.mark.parametrize("switch", [0, 2])
def test_stop_leaves_a_limp_servo_outside_its_limits_alone(switch: int) -> None:
    told = play(stop(prepared(at_12=0)), prepares(at_12=0), stands(900), reads(3, 40, switch))
    assert told is Promise.LIMP
    assert "nothing was sent" in Promise.LIMP.value


def test_stop_leaves_a_limp_servo_alone_whose_turn_nobody_knows() -> None:
    turns = prepares(at_11=0, at_12=0)
    assert play(stop(Node(3)), turns, stands(900), reads(3, 40, 0)) is Promise.LIMP


@pytest.mark.parametrize(
    ("before", "now", "line", "promise"),
    [
        (0, 1, writes(3, 46, 0, 0), Promise.ZERO_VELOCITY_ACCEPTED),
        (3, 1, writes(3, 46, 0, 0), Promise.ZERO_VELOCITY_ACCEPTED),
        (1, 2, writes(3, 44, 0, 0), Promise.ZERO_DUTY_ACCEPTED),
    ],
)
def test_stop_goes_by_the_mode_of_this_moment(before: int, now: int, line: Line, promise: Promise) -> None:
    assert play(stop(prepared(at_33=before)), prepares(at_33=now), line) is promise


def test_what_was_a_goal_is_no_step() -> None:
    for order in (stop(prepared()), move(prepared(), 1.0)):
        with pytest.raises(RequestError, match="step"):
            play(order, prepares(at_33=3))


@pytest.mark.parametrize(
    ("mode", "line", "promise"),
    [
        (1, writes(3, 46, 0, 0), Promise.ZERO_VELOCITY_ACCEPTED),
        (2, writes(3, 44, 0, 0), Promise.ZERO_DUTY_ACCEPTED),
    ],
)
def test_stop_in_other_modes_says_what_it_promises(mode: int, line: Line, promise: Promise) -> None:
    assert play(stop(prepared(at_33=mode)), prepares(at_33=mode), line) is promise


@pytest.mark.parametrize(("mode", "message"), [(3, "step mode"), (9, "operating mode 9")])
def test_stop_where_nothing_is_known_to_stop_it_names_the_way_out(mode: int, message: str) -> None:
    with pytest.raises(RequestError, match=message) as caught:
        play(stop(prepared(at_33=mode)), prepares(at_33=mode))
    assert "disable_torque()" in caught.value.advice


def test_a_stop_that_got_lost_where_no_acknowledgement_is_due_is_said_again_from_where_it_is_then() -> None:
    def said(raw: int, found: int) -> list[Line]:
        goal = low_high(raw)
        return [stands(raw), unheard(writes(3, 42, *goal)), reads(3, 42, *low_high(found))]

    asked = prepares(at_8=0)
    told = play(stop(Node(3)), asked, *said(700, 3000), *said(800, 3000), *said(900, 900))
    assert told is Promise.HOLD_ACCEPTED
    with pytest.raises(VerificationFailed):
        play(stop(Node(3)), asked, *said(700, 3000) * 3)
    zero = [
        unheard(writes(3, 46, 0, 0)),
        reads(3, 46, 9, 0),
        unheard(writes(3, 46, 0, 0)),
        reads(3, 46, 0, 0),
    ]
    assert play(stop(Node(3)), prepares(at_8=0, at_33=1), *zero) is Promise.ZERO_VELOCITY_ACCEPTED


def test_stop_of_a_new_servo_asks_it_first() -> None:
    play(stop(Node(3)), prepares(), stands(0), writes(3, 42, 0, 0))


# -- simulated servos ----------------------------------------------------------------------------------------


def later(servo: Any, seconds: float) -> None:
    servo.bus.run(Sleep(seconds))


@pytest.mark.parametrize("name", TABLES)
def test_a_limp_servo_outside_its_limits_stays_where_it_is_and_limp(name: str) -> None:
    with simulated(name) as (real, servo):
        count = TABLES[name]["goal_position"].scale
        servo.write(min_position_limit=300 * count, max_position_limit=600 * count)
        real.raw_position = 100
        assert servo.stop() is Promise.LIMP
        later(servo, 2.0)
        assert (real.raw_position, real.memory["torque_enable"]) == (100, 0)
        servo.enable_torque(jump=400 * count)
        assert servo.stop() in (Promise.OUTSIDE_ACCEPTED, Promise.HOLD_ACCEPTED)
        later(servo, 2.0)
        assert 100 <= real.raw_position <= 300


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_so_does_one_that_was_turned_out_of_its_turn(name: str) -> None:
    with simulated(name) as (real, servo):
        real.memory["phase"] |= 1 << 4
        real.raw_position = 6015
        assert servo.stop() is Promise.LIMP
        later(servo, 2.0)
        assert (real.raw_position, real.memory["torque_enable"]) == (6015, 0)


CHANGES = [
    (name, before, now)
    for name in TABLES
    for before in CONTROL[name].has
    for now in CONTROL[name].has
    if before is not now and CONTROL[name].modes and Mode.PWM not in (before, now)
]


@pytest.mark.parametrize(("name", "before", "now"), CHANGES, ids=lambda value: getattr(value, "value", value))
def test_another_object_has_changed_the_mode_since(name: str, before: Mode, now: Mode) -> None:
    """Nothing that was an order in the mode before is given, and a stop does what it promises."""
    with simulated(name) as (real, servo):
        servo.set_mode(before)
        servo.prepare()
        other = Servo(servo.bus, 3)
        other.set_mode(now)
        other.enable_torque()
        stood = real.motion.position(servo.bus.link.now())
        orders: dict[Mode, Callable[[], object]] = {
            Mode.POSITION: lambda: servo.move(1.0),
            Mode.STEP: lambda: servo.step(1.0),
            Mode.VELOCITY: lambda: servo.set_velocity(1.0),
            Mode.CURRENT: lambda: servo.set_current(1.0),
        }
        with pytest.raises(RequestError, match=f"in operating mode {now.value}"):
            orders[before]()
        later(servo, 1.0)
        assert real.motion.position(servo.bus.link.now()) == pytest.approx(stood, abs=1)
        if now is Mode.VELOCITY:
            other.set_velocity(1.0)
            later(servo, 0.5)
        if now is not Mode.STEP:
            servo.prepare()
            assert servo.settings is not None
            servo.settings = servo.settings._replace(mode=before)
            servo.stop()
            later(servo, 1.0)
            assert not real.motion.moving(servo.bus.link.now())


# -- a host that sleeps between the reading and the goal -----------------------------------------------------


class Sleepy(Played):
    """A host that sleeps for so many seconds when exchange number `at` is over, before it does the next thing."""

    def __init__(self, script: list[Line], at: int, seconds: float) -> None:
        super().__init__(script)
        self.at, self.seconds, self.slept = at, seconds, 0

    def _exchange(self, request: Any) -> Any:
        told = super()._exchange(request)
        if len(self.requests) == self.at + 1:
            self.now += self.seconds
            self.slept += 1
        return told


def test_a_reading_that_the_host_slept_over_is_taken_anew_before_it_becomes_a_goal() -> None:
    hold = writes(3, 42, *low_high(900))
    for seconds, script in (
        (OLD + 0.01, [prepares(), stands(700), stands(900), hold]),
        (OLD - 0.01, [prepares(), stands(900), hold]),
    ):
        host = Sleepy(script, 1, seconds)
        assert host.run(stop(Node(3))) is Promise.HOLD_ACCEPTED
        assert (host.script, host.slept) == ([], 1)


def test_a_goal_that_may_have_left_after_a_sleep_is_said_again_from_where_it_is_then() -> None:
    said = [prepares(), stands(700), writes(3, 42, *low_high(700))]
    again = [stands(900), writes(3, 42, *low_high(900))]
    host = Sleepy(said + again, 2, SLEPT)
    assert host.run(stop(Node(3))) is Promise.HOLD_ACCEPTED
    assert (host.script, host.slept) == ([], 1)


def test_a_stop_is_sent_however_old_its_readings_are() -> None:
    class Slow(Sleepy):
        def _exchange(self, request: Any) -> Any:
            self.at = len(self.requests)
            return super()._exchange(request)

    host = Slow([prepares(), stands(700), stands(800), stands(900), writes(3, 42, *low_high(900))], 0, 1.0)
    assert host.run(stop(Node(3))) is Promise.HOLD_ACCEPTED
    assert host.script == []
    assert host.slept == 5


@pytest.mark.parametrize("where", ["before the reply is read", "before the goal leaves"])
def test_a_servo_is_not_sent_back_to_where_it_was_before_the_host_slept(where: str) -> None:
    """It turns on for two seconds meanwhile; without a second look it would come all the way back."""
    with simulated("sts") as (real, servo):
        servo.enable_torque()
        servo.move(0.5)
        servo.move(5.5, velocity=1.0, wait=False)
        servo.bus.run(Sleep(1.0))
        line: Any = servo.bus.link
        write = line.write
        slept: list[float] = []

        def wrote(data: bytes) -> None:
            asks, orders = data[4:6] == b"\x02\x38", data[4:6] == b"\x03\x2a"
            if not slept and where == "before the goal leaves" and orders:
                slept.append(real.motion.position(real._now()))
                line.advance(2.0)
            write(data)
            if not slept and where == "before the reply is read" and asks:
                slept.append(real.motion.position(real._now()))
                line.advance(2.0)

        line.write = wrote
        assert servo.stop() is Promise.HOLD_ACCEPTED
        line.write = write
        servo.bus.run(Sleep(2.0))
        assert len(slept) == 1
        assert real.motion.position(real._now()) - slept[0] > 1000, (
            "counts; it was on its way for two seconds"
        )
