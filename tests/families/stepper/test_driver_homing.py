"""Homing ends: with the switch, without it, deaf, refused, and never with a motor that turns unless that is said."""

from __future__ import annotations

from math import tau
from typing import Any

import pytest

from motorbus.core.steps import Progress
from motorbus.errors import MotorbusError, NotHomed, OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import Homed
from motorbus.families.stepper.driver.stopping import MAY_TURN
from tests.families.stepper.loans import MINE, Line1
from tests.families.stepper.test_driver_borrowing import SELECT, failed, starts
from tests.families.stepper.test_driver_stopping import Losing, is_stopped_last

HOME = "FF AA 03 0F"
WIRED: dict[str, Any] = {"home_switch": "wired", "home_at": -3000}


def homed(device: Controller) -> Homed:
    return device.home(deadline=8.0)


def test_it_turns_until_the_switch_and_is_told_to_stop() -> None:
    line = Line1(**WIRED)
    told = line.run(homed)
    assert isinstance(told, Homed)
    assert told.velocity == pytest.approx(90 * tau / 60)
    assert told.seconds == pytest.approx(3000 / 2400, abs=0.15)
    assert "input 5 was active after 1." in str(told)
    assert is_stopped_last(line.sent)
    assert SELECT not in starts(line.sent)
    assert (line.at_rest, line.simulated.travel.position(line.simulated.state, line.now)) == (True, -3000)
    assert [one.what for one in line.events if isinstance(one, Progress)] == ["homing"] * 5


def test_at_a_speed_of_ones_own_project_1_is_borrowed() -> None:
    line = Line1(**WIRED)
    told = line.run(lambda device: device.home(velocity=4 * tau))
    assert isinstance(told, Homed)
    assert told.seconds < 0.7
    assert (line.as_before, line.journal.unfinished()) == (True, None)


@pytest.mark.parametrize(
    ("at_most", "rpm"), [(100 * tau / 60, 90), (90 * tau / 60, 90), (61.5 * tau / 60, 61)]
)
def test_project_1_is_borrowed_where_it_is_faster_than_it_may(at_most: float, rpm: int) -> None:
    line = Line1(**WIRED)
    told = line.run(lambda device: device.home(deadline=8.0, at_most=at_most))
    assert isinstance(told, Homed)
    assert told.velocity == pytest.approx(rpm * tau / 60)
    assert (SELECT in starts(line.sent)) == (rpm < 90)
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_nothing_homes_slower_than_one_rpm() -> None:
    line = Line1(**WIRED)
    failed(line.run(lambda device: device.home(at_most=0.5 * tau / 60)), RequestError, "whole RPM")
    assert HOME not in starts(line.sent)


def test_a_switch_that_never_comes_meets_the_deadline() -> None:
    line = Line1(home_switch="never")
    failed(line.run(homed), NotHomed, "not active within 8 s, so homing was stopped")
    assert 8.0 < line.now < 9.0
    line.later(1.0)
    assert line.at_rest


@pytest.mark.parametrize("options", [{"home_switch": "stuck"}, {"input_polarity": "low"}])
def test_a_switch_that_is_active_already_refuses(options: dict[str, Any]) -> None:
    line = Line1(**options)
    failed(line.run(homed), NotHomed, "active already")
    assert HOME not in starts(line.sent)
    assert SELECT not in starts(line.sent)
    assert line.simulated.position == 0


def test_a_switch_that_sticks_later_is_at_most_a_wrong_place() -> None:
    """What reads active twice is believed; the controller has stopped at it as well."""
    line = Line1()
    line.simulator.press(5, True, 1.0)
    assert isinstance(line.run(homed), Homed)
    assert line.at_rest


@pytest.mark.parametrize("bounce_ms", [0.5, 5.0, 30.0])
def test_a_contact_that_bounces(bounce_ms: float) -> None:
    line = Line1(bounce=4, bounce_ms=bounce_ms)
    line.simulator.press(5, True, 1.0)
    assert isinstance(line.run(homed), Homed)
    line.later(1.0)
    assert line.at_rest


def test_a_lost_acknowledgement_means_stop() -> None:
    line = Line1(**WIRED)
    line.line = Losing(HOME, 1)
    failed(line.run(homed), OutcomeUnknown)
    assert is_stopped_last(line.sent)
    line.later(1.0)
    assert line.at_rest


def test_an_input_that_cannot_be_read_means_stop() -> None:
    line = Line1(home_switch="never")
    lossy = Losing("FF AA 00 0B", 0)
    line.line = lossy

    def lose(event: object, bus: object) -> None:
        lossy.times = 1_000_000 if isinstance(event, Progress) else 0

    line.react = lose  # from the first report of progress on, 0.25 s after it began to turn
    assert isinstance(line.run(homed), MotorbusError)
    assert is_stopped_last(line.sent)
    line.later(1.0)
    assert (line.at_rest, line.now < 5.0) == (True, True)


@pytest.mark.parametrize("home_switch", ["never", "wired"])
def test_one_that_is_deaf_while_it_moves(home_switch: str) -> None:
    """It hears the stop when it has met its switch, and else never: nothing can be done about it but to say so."""
    line = Line1(home_switch=home_switch, home_at=-3000, deaf_while_moving=True)
    told = line.run(homed)
    assert isinstance(told, MotorbusError)
    assert line.at_rest == (home_switch == "wired")
    assert (MAY_TURN in told.summary) == (home_switch == "never")


@pytest.mark.parametrize("lost", ["FF AA 5E", "FF AA 03 0D"])
def test_a_stop_that_is_not_accepted_is_said_though_it_has_homed(lost: str) -> None:
    line = Line1(**WIRED)
    line.line = Losing(lost)
    failed(line.run(homed), OutcomeUnknown, MAY_TURN)


@pytest.mark.parametrize("fault", ["lost", "late", "doubled", "bit", "other", "split", "noise", "unheard"])
@pytest.mark.parametrize("every", [2, 3, 7, 13])
@pytest.mark.parametrize("home_switch", ["wired", "never", "stuck"])
def test_whatever_happens_to_replies_the_motor_stands_or_it_is_said(
    home_switch: str, fault: str, every: int
) -> None:
    line = Line1(home_switch=home_switch, home_at=-3000, reply_fault=fault, fault_every=every)
    told = line.run(lambda device: device.home(deadline=3.0))
    line.later(0.5)
    assert line.at_rest or (isinstance(told, MotorbusError) and MAY_TURN in told.summary), told
    if home_switch != "wired" and isinstance(told, Homed):
        assert fault == "bit", "a level has no checksum: the wrong bit twice in a row is believed"


def test_without_a_speed_there_is_no_homing() -> None:
    for project in (MINE.with_step(1, speed=0), None):
        line = Line1(project, shipped="empty")
        failed(line.run(homed), RequestError, "has no speed" if project else "is cleared")
        assert HOME not in starts(line.sent)


@pytest.mark.parametrize("said", [0, -1, 601, float("nan"), "soon"])
def test_a_deadline_is_needed(said: Any) -> None:
    line = Line1()
    failed(line.run(lambda device: device.home(deadline=said)), RequestError, "deadline")
    assert line.sent == []
