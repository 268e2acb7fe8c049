"""A motion by hand is stopped on lines that lose what stops it, and nothing begins behind a stop."""

from __future__ import annotations

from collections.abc import Callable
from math import tau
from typing import Any

import pytest

from motorbus.core.steps import Procedure, Progress, Sleep, catch, gather
from motorbus.errors import Interrupted, MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller, driver
from motorbus.families.stepper.driver import Moved, Outcome, Ran
from motorbus.families.stepper.driver.borrowing import NOTE
from motorbus.families.stepper.driver.stopping import MAY_TURN, Promise
from tests.families.stepper.loans import Line1
from tests.families.stepper.test_driver_borrowing import MOVE, starts
from tests.families.stepper.test_driver_stopping import MOTOR, PROJECT, Losing

Work = Callable[[Controller], Any]
BEGIN = (MOVE, "FF AA 4E 01", "FF AA 03 0F")
NOTHING = "none"
LOST = [NOTHING, "FF AA 5E", "FF AA 03 0D", "FF AA"]
"""Replies that never come: to neither, to stop project, to stop motor, to anything."""
ENDLESS: dict[str, Work] = {
    "jog": lambda device: device.jog(tau, 50.0),
    "jog_forward": lambda device: device.jog_forward(50.0),
    "home": lambda device: device.home(deadline=50.0),
    "home with a speed": lambda device: device.home(deadline=50.0, velocity=tau),
}


def losing(lost: str, at: float = 2.0) -> Line1:
    """A line that loses these replies from a moment on at which the motor turns."""
    line = Line1(home_switch="never")

    class Later(Losing):
        def carry(self, sender: Any, data: Any, moment: float) -> Any:
            self.times = 1_000_000 if moment >= at else 0
            return super().carry(sender, data, moment)

    if lost != NOTHING:
        line.line = Later(lost)
    return line


def said(error: BaseException) -> str:
    return "\n".join([str(error), *getattr(error, "__notes__", ())])


@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("verb", ENDLESS)
@pytest.mark.parametrize("again", [(), (2.51,), (2.9,)])
def test_ctrl_c_once_and_twice(verb: str, lost: str, again: tuple[float, ...]) -> None:
    """It stands, though nobody may know; and who knows less than that is told so."""
    line = losing(lost)
    line.interrupts = [2.5, *again]
    with pytest.raises(KeyboardInterrupt) as caught:
        line.run(ENDLESS[verb])
    line.later(2.0)
    assert line.at_rest
    unfinished = line.journal.unfinished() is not None
    assert unfinished or line.as_before
    assert (NOTE in said(caught.value)) == unfinished
    if lost != NOTHING:
        assert MAY_TURN in said(caught.value)
    if not again and lost == NOTHING:
        assert said(caught.value) == ""


@pytest.mark.parametrize("lost", LOST[1:])
@pytest.mark.parametrize("verb", ENDLESS)
def test_what_ends_it_leaves_first_whatever_is_not_accepted(verb: str, lost: str) -> None:
    line = losing(lost)
    line.interrupts = [2.5]
    with pytest.raises(KeyboardInterrupt):
        line.run(ENDLESS[verb])
    stops = [one for one in line.sent if one in (MOTOR, PROJECT)]
    assert stops[:2] == [MOTOR, PROJECT]


@pytest.mark.parametrize("lost", LOST[1:])
def test_a_deadline_on_such_a_line(lost: str) -> None:
    line = losing(lost)
    told = line.run(lambda device: device.home(deadline=2.5))
    assert isinstance(told, OutcomeUnknown)
    assert MAY_TURN in told.summary
    line.later(1.0)
    assert line.at_rest


@pytest.mark.parametrize(
    "work",
    [
        lambda device: device.home(deadline=5.0),
        lambda device: device.jog_forward(3.0),
        lambda device: device.home(deadline=5.0, velocity=tau),
    ],
)
def test_an_echo_of_the_stop_is_no_stop(work: Work) -> None:
    """A controller that hears nothing while it turns, on a line that gives back the first bytes of what it is told."""
    line = Line1(home_switch="never")
    line.pace = True

    def deafen(event: object, bus: Any) -> None:
        if isinstance(event, Progress) and event.done > 500:
            line.simulated.switch(echo="six", deaf_while_moving=True)

    line.react = deafen
    told = line.run(lambda device: (device.read_project(1), work(device)))
    assert isinstance(told, MotorbusError)
    assert MAY_TURN in said(told)
    assert not line.at_rest


def beside(line: Line1, *works: Callable[[Controller], Procedure[Any]]) -> list[Any]:
    """What came of these, begun a tenth of a second apart."""

    async def after(seconds: float, device: Controller, work: Callable[[Controller], Procedure[Any]]) -> Any:
        await Sleep(seconds)
        return await catch(work(device))

    def together(device: Controller) -> list[Any]:
        branches = [after(0.1 * number, Controller(device.bus), work) for number, work in enumerate(works)]
        return list(device.bus.run(gather(*branches)))

    found = line.run(together)
    assert isinstance(found, list)
    return found


def turning(device: Controller) -> Procedure[Any]:
    return driver.jog(device, tau, 30.0)


def stopped_at(moment: float) -> Callable[[Controller], Procedure[Any]]:
    async def stopping(device: Controller) -> Any:
        await Sleep(moment)
        return await driver.stop(device)

    return stopping


SECONDS: dict[str, Callable[[Controller], Procedure[Any]]] = {
    "jog": lambda device: driver.jog(device, -tau, 2.0),
    "run_once": lambda device: driver.run_once(device),
    "home": lambda device: driver.home(device, deadline=3.0),
    "run": lambda device: driver.run(device, 1),
    "start_project": lambda device: driver.start_project(device, 1),
}


@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("second", SECONDS)
def test_a_stop_calls_off_what_waits_also_where_it_is_not_accepted(second: str, lost: str) -> None:
    """What turns is ended, and what was asked for before does not begin behind it."""
    line = losing(lost)
    first, waited, stopped = beside(line, turning, SECONDS[second], stopped_at(2.5))
    assert isinstance(first, Interrupted if lost == NOTHING else OutcomeUnknown)
    assert isinstance(waited, MotorbusError), waited
    assert (stopped is Promise.STOP_ACCEPTED) == (lost == NOTHING)
    assert starts(line.sent).count(MOVE) == 1
    assert not {"FF AA 4E 01", "FF AA 03 0F"} & set(starts(line.sent))
    line.later(1.0)
    assert line.at_rest


@pytest.mark.parametrize("second", ["run_once", "run"])
@pytest.mark.parametrize("losses", [1, 4])
def test_a_stop_that_is_still_being_said_calls_off_what_waits(second: str, losses: int) -> None:
    """The stop at the end of the first may be accepted before it is."""
    line = Line1(home_switch="never")
    line.line = Losing("FF AA 5E", losses)
    first, waited, stopped = beside(line, turning, SECONDS[second], stopped_at(2.5))
    assert isinstance(first, Interrupted)
    assert isinstance(waited, Interrupted), waited
    assert stopped is Promise.STOP_ACCEPTED
    assert (line.as_before, line.journal.unfinished()) == (True, None)


@pytest.mark.parametrize("second", SECONDS)
def test_what_is_asked_for_meanwhile_waits_and_then_begins(second: str) -> None:
    """The stop at the end of the first is not meant for it, nor is the open journal of the first its affair."""
    line = Line1(home_switch="wired", home_at=-1000)
    first, waited = beside(line, lambda device: driver.jog(device, tau, 1.0), SECONDS[second])
    assert isinstance(first, Moved)
    assert not isinstance(waited, MotorbusError), waited
    if isinstance(waited, Ran):
        assert waited.outcome is Outcome.COMPLETED
    order = starts(line.sent)
    assert order.index(PROJECT[:11]) < max(place for place, one in enumerate(order) if one in BEGIN)


def test_a_motion_that_is_asked_for_while_a_project_runs_is_refused() -> None:
    line = Line1()
    first, second = beside(line, SECONDS["run"], SECONDS["jog"])
    assert isinstance(first, Ran)
    assert first.outcome is Outcome.COMPLETED
    assert isinstance(second, RequestError)
    assert "may still run" in second.summary


@pytest.mark.parametrize("second", SECONDS)
def test_an_emergency_and_a_reset_call_off_what_waits(second: str) -> None:
    line = Line1(home_switch="never")

    async def strike(device: Any) -> Any:
        await Sleep(2.5)
        device.bus.estop()
        device.bus.reset()

    first, waited, _ = beside(line, turning, SECONDS[second], strike)
    assert isinstance(first, Interrupted)
    assert isinstance(waited, Interrupted), waited
    assert starts(line.sent).count(MOVE) == 1
    assert not {"FF AA 4E 01", "FF AA 03 0F"} & set(starts(line.sent))
    assert (line.as_before, line.at_rest, line.journal.unfinished()) == (True, True, None)


@pytest.mark.parametrize("moment", [0.1, 0.2, 0.3, 0.45])
@pytest.mark.parametrize("work", SECONDS)
def test_an_emergency_and_a_reset_call_off_what_is_being_prepared(work: str, moment: float) -> None:
    """On a line that takes its time: project 1 is being read."""
    line = Line1(home_switch="never")
    line.pace = True

    async def strike(device: Any) -> Any:
        await Sleep(moment - 0.1)
        device.bus.estop()
        device.bus.reset()

    told, _ = beside(line, SECONDS[work], strike)
    assert isinstance(told, Interrupted), told
    assert not set(BEGIN) & set(starts(line.sent))
    assert (line.as_before, line.journal.unfinished()) == (True, None)
