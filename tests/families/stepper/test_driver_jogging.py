"""By an angle, or for a while: what is edited for it, to the pulse; what is refused; and how it is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from math import tau
from typing import Any

import pytest

from motorbus.core.steps import Sleep
from motorbus.errors import Interrupted, OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import Moved, Outcome, Ran
from motorbus.families.stepper.driver.jogging import paced, shaped, whole_rpm
from motorbus.families.stepper.table import Project
from tests.families.stepper.loans import MINE, Line1
from tests.families.stepper.test_driver_borrowing import MOVE, SELECT, failed, starts
from tests.families.stepper.test_driver_stopping import Losing, is_stopped_last


def test_a_jog_is_one_move_of_velocity_times_seconds() -> None:
    line = Line1()
    told = line.run(lambda device: device.jog(-tau, 1.25))
    assert isinstance(told, Moved)
    assert line.simulated.position == -2000
    assert told.angle == pytest.approx(-1.25 * tau)
    assert told.velocity == pytest.approx(-tau)
    assert 1.25 < told.seconds < 2.0
    assert str(told).startswith("estimated: -7.85398 rad at -6.28319 rad/s (60 RPM)")


def test_the_motor_has_come_to_its_end_before_it_is_stopped() -> None:
    for ramp in ({"ramp": "pulse"}, {"ramp_tick_ms": 10.0}, {}):
        line = Line1(**ramp)
        line.run(lambda device: device.move_by(3 * tau, velocity=10 * tau))
        assert line.simulated.position == 4800, ramp


def test_move_by_keeps_the_speed_of_step_1_when_none_is_said() -> None:
    line = Line1()
    told = line.run(lambda device: device.move_by(tau))
    assert isinstance(told, Moved)
    assert told.velocity == pytest.approx(90 * tau / 60)
    assert line.simulated.position == 1600
    failed(
        Line1(MINE.with_step(1, speed=0)).run(lambda device: device.move_by(tau)), RequestError, "no speed"
    )


def test_an_acceleration_is_sent_as_the_controller_has_it() -> None:
    line = Line1()
    line.run(lambda device: device.move_by(tau, velocity=tau, acceleration=77))
    assert any(one.startswith("FF AA 03 05 4D 00 3C 00 00 01") for one in line.sent)


@pytest.mark.parametrize("acceleration", [-1, 65_536, 1.5, 30.0, True, "30", 10**400])
def test_an_acceleration_that_no_frame_holds_is_refused_before_anything_is_sent(acceleration: Any) -> None:
    line = Line1()
    for work in (
        lambda device: device.move_by(tau, velocity=tau, acceleration=acceleration),
        lambda device: device.jog(tau, 1.0, acceleration=acceleration),
    ):
        failed(line.run(work), RequestError, "acceleration: ")
        assert (line.sent, line.journal.unfinished()) == ([], None)


@pytest.mark.parametrize("much", [1e9, 1e306, 1e308, 10**300, 10**400])
def test_what_is_too_much_for_any_number_is_refused(much: Any) -> None:
    for work in (
        lambda device: device.move_by(much),
        lambda device: device.move_by(-much),
        lambda device: device.move_by(tau, velocity=much),
        lambda device: device.jog(-much, 60.0),
        lambda device: device.jog_forward(much),
        lambda device: device.home(deadline=much),
        lambda device: device.home(velocity=much),
    ):
        line = Line1()
        failed(line.run(work), RequestError)
        assert {one[:8] for one in line.sent} <= {"FF AA 3E"}


@pytest.mark.parametrize(
    ("velocity", "rpm"),
    [(tau, 60), (tau / 60, 1), (1.1 * tau / 60, 1), (1.9 * tau / 60, 2), (65535 * tau / 60, 65535)],
)
def test_a_speed_is_whole_rpm(velocity: float, rpm: int) -> None:
    assert whole_rpm(velocity) == rpm


@pytest.mark.parametrize("rpm", [0, 0.4, 0.8, 1.2, 1.5, 2.4, 65540.0, 1e9, -5])
def test_a_speed_that_is_more_than_a_tenth_off_is_refused(rpm: float) -> None:
    with pytest.raises(RequestError) as caught:
        whole_rpm(rpm * tau / 60)
    assert "rad/s" in caught.value.expected


@pytest.mark.parametrize(("rpm", "cause"), [(-3, "not above 0"), (0, "not above 0"), (1.5, "10 % off")])
def test_a_refused_speed_says_why(rpm: float, cause: str) -> None:
    with pytest.raises(RequestError) as caught:
        whole_rpm(rpm * tau / 60)
    assert cause in caught.value.cause


def test_a_refused_speed_names_its_neighbours() -> None:
    with pytest.raises(RequestError) as caught:
        whole_rpm(1.5 * tau / 60)
    assert caught.value.expected == "0.1047 rad/s (1 RPM) or 0.2094 rad/s (2 RPM)"


def test_pulses_are_whole_where_those_of_a_turn_are_not() -> None:
    odd = replace(MINE, step_angle=175)
    assert odd.pulses_per_turn == Fraction(11520, 7)
    found = shaped(odd, 2.5 * tau)
    assert (found.turn_distance, found.step(1).distance) == (11520, 7 * round(2.5 * 11520 / 7))
    assert found.step(1).distance * (found.pulses_per_unit or 0) == round(2.5 * 11520 / 7)


def test_where_a_pulse_is_no_unit_a_hundredth_of_a_degree_is() -> None:
    fine = replace(MINE, microsteps=65535, step_angle=1)
    found = shaped(fine, -tau / 4)
    assert (found.turn_distance, found.step(1).distance, found.step(1).direction) == (36000, 9000, 1)
    with pytest.raises(RequestError, match="too far"):
        shaped(fine, 500 * tau)
    with pytest.raises(RequestError, match="too far"):
        shaped(MINE, 20_000 * tau)


def test_less_than_a_pulse_never_leaves_for_it_may_have_no_end() -> None:
    for work in (
        lambda device: device.move_by(0.0, velocity=tau),
        lambda device: device.move_by(0.4 * tau / 1600, velocity=tau),
        lambda device: device.jog(tau, 1e-4),
    ):
        line = Line1(zero_distance="endless")
        failed(line.run(work), RequestError, "less than one pulse")
        assert SELECT not in starts(line.sent)
    line = Line1(MINE.with_step(1, distance=0), zero_distance="endless")
    failed(line.run(lambda device: device.run_once()), RequestError, "less than one pulse")
    assert set(starts(line.sent)) == {"FF AA 3E 01"}, "nor a stop, for nothing was moved"


def test_one_that_is_deaf_while_it_moves_hears_the_stop_when_it_has_come_to_its_end() -> None:
    line = Line1(deaf_while_moving=True)
    assert isinstance(line.run(lambda device: device.jog(tau, 2.0)), Moved)
    assert (line.simulated.position, line.as_before, line.journal.unfinished()) == (3200, True, None)


@pytest.mark.parametrize(
    ("start", "acceleration", "rpm", "expected"),
    [
        (60, 40, 90, (60, 40)),
        (0, 0, 90, (50, 30)),
        (5000, 40, 90, (1200, 40)),
        (0, 40, 1, (13, 40)),
        (50, 40, 1, (13, 40)),
    ],
)
def test_the_ramp_is_that_of_step_1_where_it_makes_sense(
    start: int, acceleration: int, rpm: int, expected: tuple[int, int]
) -> None:
    step = paced(MINE.with_step(1, start_frequency=start, acceleration=acceleration), rpm, None).step(1)
    assert (step.start_frequency, step.acceleration) == expected


def test_run_once_makes_the_move_of_project_1() -> None:
    line = Line1()
    told = line.run(lambda device: device.run_once())
    assert isinstance(told, Moved)
    assert line.simulated.position == -28
    assert told.angle == pytest.approx(-7 / 400 * tau)
    assert (SELECT in starts(line.sent), is_stopped_last(line.sent)) == (False, True)


@pytest.mark.parametrize(("verb", "sign"), [("jog_forward", 1), ("jog_reverse", -1)])
def test_the_endless_jog_is_bounded_by_this_host(verb: str, sign: int) -> None:
    line = Line1()
    told = line.run(lambda device: getattr(device, verb)(1.0))
    assert isinstance(told, Moved)
    assert line.simulated.position * sign > 2000
    assert told.angle == pytest.approx(line.simulated.position * tau / 1600, abs=0.6)
    line.later(1.0)
    assert (line.at_rest, is_stopped_last(line.sent)) == (True, True)
    failed(
        Line1(None, shipped="empty").run(lambda device: getattr(device, verb)(1.0)),
        RequestError,
        "is cleared",
    )


def test_without_waiting_it_goes_on_where_nothing_was_borrowed() -> None:
    line = Line1(replace(MINE, turn_distance=1600).with_step(1, direction=0, distance=16000, speed=60))
    told = line.run(lambda device: device.move_by(10 * tau, velocity=tau, wait=False))
    assert isinstance(told, Moved)
    assert told.promise is None
    assert (line.at_rest, line.sent[-1][:11]) == (False, MOVE)
    line.later()
    assert line.simulated.position == 16000
    line = Line1()
    failed(line.run(lambda device: device.move_by(tau, velocity=tau, wait=False)), RequestError, "wait=False")
    assert SELECT not in starts(line.sent)


LEFT = replace(MINE, turn_distance=1600).with_step(1, direction=0, distance=16000, speed=60)
"""A project 1 of which ten turns at 60 RPM need not borrow anything."""


def leave(device: Controller) -> Moved:
    return device.move_by(10 * tau, velocity=tau, wait=False)


def test_what_was_left_to_itself_is_not_forgotten() -> None:
    """It takes ten seconds and more: nothing else begins meanwhile, but a stop."""
    others: tuple[Callable[[Controller], object], ...] = (
        leave,
        lambda device: device.jog(-tau, 1.0),
        lambda device: device.home(),
        lambda device: device.jog_reverse(1.0),
        lambda device: device.run(1),
        lambda device: device.start_project(1),
    )
    for other in others:
        line = Line1(LEFT)

        def both(device: Controller, other: Callable[[Controller], object] = other) -> object:
            leave(device)
            return other(device)

        failed(line.run(both), RequestError, "a move may not be over")
        assert len(line.sent) == 3
        line.later()
        assert line.simulated.position == 16000


def test_what_was_left_is_over_with_its_time_or_with_a_stop() -> None:
    line = Line1(LEFT)

    def waits(device: Controller) -> Moved:
        told = leave(device)
        device.bus.run(Sleep(told.seconds))
        return device.jog(-tau, 1.0)

    assert isinstance(line.run(waits), Moved)
    assert line.simulated.position == 16000 - 1600
    line = Line1(LEFT)
    assert isinstance(line.run(lambda device: (leave(device), device.stop(), device.jog(-tau, 1.0))), tuple)


def test_one_that_is_to_be_left_is_stopped_where_it_was_not_acknowledged() -> None:
    line = Line1(LEFT)
    line.line = Losing(MOVE, 1)
    failed(line.run(leave), OutcomeUnknown)
    assert (is_stopped_last(line.sent), line.at_rest) == (True, True)


def test_run_can_stop_what_was_left() -> None:
    line = Line1(LEFT)
    told = line.run(lambda device: (leave(device), device.run(1, stop_first=True))[1])
    assert isinstance(told, Ran)
    assert told.outcome is Outcome.COMPLETED


@pytest.mark.parametrize("seconds", [0, -1, 60.1, float("inf"), float("nan"), True, None, "1"])
def test_a_time_is_bounded(seconds: Any) -> None:
    line = Line1()
    for work in (lambda device: device.jog(tau, seconds), lambda device: device.jog_forward(seconds)):
        failed(line.run(work), RequestError, "seconds")
        assert line.sent == []


@pytest.mark.parametrize("bad", [float("inf"), float("nan"), "fast", None, True])
def test_what_is_no_number_is_refused(bad: Any) -> None:
    line = Line1()
    for work in (lambda device: device.move_by(bad, velocity=tau), lambda device: device.jog(bad, 1.0)):
        failed(line.run(work), RequestError, "not a finite number")
        assert line.sent == []


def test_after_an_emergency_stop_nothing_moves_before_it_is_reset() -> None:
    line = Line1()

    def latched(device: Any) -> object:
        device.ping()
        device.bus.estop()
        return device.jog(tau, 0.5)

    failed(line.run(latched), Interrupted)
    assert (MOVE in starts(line.sent), line.as_before) == (False, True)


def test_a_project_without_geometry_has_no_turn() -> None:
    line = Line1(replace(Project(number=1, total_steps=1), turn_distance=5))
    failed(line.run(lambda device: device.jog(tau, 1.0)), RequestError, "no project says how many pulses")
