"""Ctrl-C at every line that takes part in a borrow, a jog or a homing: the motor stands, and project 1 is given back.

Or the interruption itself says that it is not, with the journal open, and `recover` does it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import tau
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import motorbus
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import borrowing, editing, homing, jogging, recovery, stopping, turning
from motorbus.families.stepper.driver.borrowing import NOTE
from motorbus.families.stepper.driver.turning import Slowing
from tests.families.stepper.loans import Cut, Line1
from tests.families.stepper.test_borrow_cuts import WORKS, homed, jogged, wrecked

PACKAGE = Path(motorbus.__file__).parent
FILES = {
    *(str(one.__file__) for one in (borrowing, editing, homing, jogging, recovery, stopping, turning)),
    str(PACKAGE / "core" / "operation.py"),
    str(PACKAGE / "journal.py"),
}
Work = Callable[[Controller], object]
Rounds = Callable[[int], int]
START: list[str] | None = []
"""What the interruption before the first one has said."""


class Interrupt:
    """Raises KeyboardInterrupt before the nth line of these files that is executed; `later` lines on, once more."""

    def __init__(self, at: int, later: int = 0) -> None:
        self.at = {at, at + later}
        self.count = 0

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        if frame.f_code.co_filename not in FILES:
            return None
        if event == "line":
            self.count += 1
            if self.count in self.at:
                raise KeyboardInterrupt
        return self


def interrupted(line: Line1, work: Work, interrupt: Interrupt) -> list[str] | None:
    """What the interruption says; None when it came to its end."""
    before = sys.gettrace()
    sys.settrace(interrupt)
    try:
        line.run(work)
    except KeyboardInterrupt as error:
        return list(getattr(error, "__notes__", ()))
    finally:
        sys.settrace(before)
    return None


def check(line: Line1, notes: list[str] | None, at: object) -> None:
    """The motor stands, and project 1 is as it was, or whoever was interrupted knows, and the next one mends it."""
    if line.journal.unfinished() is None:
        assert line.as_before, at
    else:
        assert notes is not None, at
        assert NOTE in notes, at
        assert line.run(line.recovery) == "old", at
        assert line.as_before, at
    line.later(2.0)
    assert line.at_rest, at


def apart(rounds: Rounds, usual: int) -> int:
    """How many lines lie between two interruptions: in the long runs none, else so many."""
    return 1 if rounds(1_000_000) == 1_000_000 else usual


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("verb", [*WORKS, "jog_forward", "home as it is"])
def test_at_every_line(verb: str, rounds: Rounds) -> None:
    more: dict[str, Any] = {"home_switch": "wired", "home_at": -30} if verb.startswith("home") else {}
    works: dict[str, Work] = {
        **{name: work for name, (work, _) in WORKS.items()},
        "jog_forward": lambda device: device.jog_forward(0.2),
        "home as it is": lambda device: device.home(deadline=5.0),
    }
    at, notes = 0, START
    while notes is not None:
        at += apart(rounds, 127)
        line = Line1(**more)
        notes = interrupted(line, works[verb], Interrupt(at))
        check(line, notes, at)
    assert at > 150


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("later", [1, 3, 8, 21, 55, 89])
def test_twice(later: int, rounds: Rounds) -> None:
    at, notes = 0, START
    while notes is not None:
        at += apart(rounds, 211)
        line = Line1()
        notes = interrupted(line, jogged, Interrupt(at, later))
        check(line, notes, at)


@pytest.mark.timeout(1800)
def test_at_every_line_of_a_recovery(rounds: Rounds) -> None:
    at, notes = 0, START
    while notes is not None:
        at += apart(rounds, 29)
        line = wrecked(Cut(7), jogged, {})
        notes = interrupted(line, line.recovery, Interrupt(at))
        line.run(line.recovery)
        assert (line.as_before, line.journal.unfinished()) == (True, None), at
    assert at > 150


@pytest.mark.timeout(1800)
def test_a_homing_that_finds_nothing(rounds: Rounds) -> None:
    """Wherever it is interrupted, a motor that would never come to its end is stopped."""
    at, notes = 0, START
    while notes is not None:
        at += apart(rounds, 101)
        line = Line1(home_switch="never")
        notes = interrupted(line, homed, Interrupt(at))
        check(line, notes, at)
        if at > 1500:
            break
    assert at > 1500


@pytest.mark.parametrize("moment", [0.3, 0.7, 0.9, 1.0, 1.1, 2.0, 3.5])
def test_on_a_line_that_takes_its_time(moment: float) -> None:
    """Stop, reading and giving back take more than a second of the two that an interrupted caller waits for them."""
    line = Line1()
    line.pace = True

    def interrupt(event: object, bus: Any) -> None:
        if not struck and bus.link.now() >= moment:
            struck.append(event)
            raise KeyboardInterrupt

    struck: list[object] = []
    line.react = interrupt
    with pytest.raises(KeyboardInterrupt) as caught:
        line.run(lambda device: device.jog(tau, 5.0))
    assert NOTE not in getattr(caught.value, "__notes__", ())
    assert (line.as_before, line.journal.unfinished(), line.at_rest) == (True, None, True)


def test_who_waits_for_the_motor_to_come_to_rest_is_told() -> None:
    line = Line1()
    line.interrupts = [3.0]
    with pytest.raises(KeyboardInterrupt):
        line.run(lambda device: device.jog(2 * tau, 5.0, acceleration=3))
    (slowing,) = [one for one in line.events if isinstance(one, Slowing)]
    assert slowing.seconds == pytest.approx(10.47, abs=0.01)
    assert (line.as_before, line.journal.unfinished()) == (True, None)
