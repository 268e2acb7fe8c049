"""What a run comes to, told by events in any order, without a bus."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

import pytest

from motorbus.core.operation import Notice
from motorbus.errors import OutcomeUnknown
from motorbus.families.stepper.driver import Memory, Outcome
from motorbus.families.stepper.driver.waiting import CLOCK, Wait
from motorbus.families.stepper.program import plan
from motorbus.families.stepper.program.earliest import earliest
from tests.protocol.stepper.execution.course import project, step

PAUSE = project(step(distance=0, delay=10_000))
WAITS = project(step(distance=0, delay=10_000, start_input=1))
LOST = OutcomeUnknown("node 1 did not answer")


def notice(at: float, kind: str = "completed") -> Notice:
    return Notice(1, kind, b"\xee\xdd", at)


class Case:
    """A run that was asked for at 100 s."""

    def __init__(self, made: Any = PAUSE, timeout: float | None = None) -> None:
        self.memory = Memory()
        self.memory.owed = True
        self.wait = Wait(self.memory, plan(made), 100.0, timeout)

    def result(self, now: float) -> Any:
        self.wait.look(now)
        ran = self.wait.ran
        return (ran.outcome, ran.seconds) if ran else (None, None)

    @property
    def why(self) -> str:
        assert self.wait.ran is not None
        return self.wait.ran.why


def test_a_notice_in_time_is_its_end() -> None:
    case = Case()
    case.wait.begun(100.02)
    assert case.wait.heard(notice(110.02)) is True
    outcome, seconds = case.result(110.02)
    assert (outcome, seconds) == (Outcome.COMPLETED, pytest.approx(10.0))
    assert case.why == "its notice came 10.000 s after its acknowledgement"
    assert case.memory.owed is False


def test_a_notice_and_the_acknowledgement_in_one_reading_are_in_order() -> None:
    case = Case(project(step(distance=0)))
    assert case.wait.heard(notice(100.02)) is True  # somebody should look
    assert case.result(100.02) == (None, None)
    case.wait.begun(100.02)
    assert case.result(100.02) == (Outcome.COMPLETED, 0.0)


def test_a_notice_before_the_acknowledgement_is_another_ones() -> None:
    case = Case(project(step(distance=0)))
    case.wait.heard(notice(100.01))
    case.wait.begun(100.02)
    assert case.result(100.02) == (None, None)
    assert case.result(200.0)[0] is Outcome.UNKNOWN
    assert case.memory.owed is True


@pytest.mark.parametrize("lost", [False, True])
def test_a_notice_that_comes_too_early_is_not_its_end(lost: bool) -> None:
    case = Case()
    least = earliest(PAUSE) * CLOCK
    if lost:
        case.wait.unacknowledged(LOST)
    else:
        case.wait.begun(100.02)
    assert case.wait.heard(notice(100.0 + least - 1e-6)) is False
    assert case.result(110.0) == (None, None)
    assert case.memory.owed is True
    case.wait.heard(notice(100.0 + least + 1e-6))
    assert case.result(110.0)[0] is Outcome.COMPLETED


def test_only_notices_that_come_too_early_leave_it_unknown() -> None:
    case = Case()
    case.wait.begun(100.02)
    case.wait.heard(notice(103.0))
    assert case.result(114.0) == (None, None)
    assert case.result(114.03) == (Outcome.UNKNOWN, None)
    assert "3.000 s after the start, and it cannot end before 9.800 s" in case.why
    assert case.memory.owed is True


def test_one_notice_that_two_listeners_hear_is_one() -> None:
    case = Case()
    case.wait.begun(100.02)
    one = notice(110.5)
    assert case.wait.heard(one) is True
    assert case.wait.heard(one) is True
    assert case.result(111.0) == (Outcome.COMPLETED, pytest.approx(10.48))


def test_another_kind_of_notice_is_nothing() -> None:
    case = Case()
    case.wait.begun(100.02)
    assert case.wait.heard(notice(110.5, "alarm")) is False
    assert case.result(114.1)[0] is Outcome.TIMEOUT


def test_a_stop_that_was_accepted_is_the_end() -> None:
    case = Case()
    case.wait.begun(100.02)
    case.memory.stops += 1
    assert case.result(101.0) == (Outcome.STOPPED, None)
    assert "stop by this host" in case.why


def test_stops_before_it_do_not_count() -> None:
    memory = Memory()
    memory.stops = 3
    wait = Wait(memory, plan(PAUSE), 100.0)
    wait.begun(100.02)
    wait.look(101.0)
    assert wait.ran is None


@pytest.mark.parametrize(("accepted", "outcome"), [(True, Outcome.STOPPED), (False, Outcome.UNKNOWN)])
def test_a_notice_while_a_stop_is_said_is_not_taken_for_its_end(accepted: bool, outcome: Outcome) -> None:
    """A device may say it after a stop too, and says it before both commands are acknowledged."""
    case = Case()
    case.wait.begun(100.02)
    case.memory.stopping = 1
    case.wait.heard(notice(112.0))
    assert case.result(112.0) == (None, None)
    case.memory.stopping = 0
    case.memory.stops += accepted
    assert case.result(112.3) == (outcome, None)


def test_a_notice_before_the_stop_is_its_end() -> None:
    case = Case()
    case.wait.begun(100.02)
    case.wait.heard(notice(112.0))
    case.memory.stops += 1
    assert case.result(112.3)[0] is Outcome.COMPLETED


def test_input_4_ends_it_and_what_it_started_may_still_be_owed() -> None:
    case = Case()
    case.wait.begun(100.02)
    case.wait.button()
    assert case.result(101.0) == (Outcome.STOPPED, None)
    assert "input 4" in case.why
    assert case.memory.owed is True


@pytest.mark.parametrize(
    ("made", "timeout", "lost", "deadline"),
    [
        (PAUSE, None, False, 100.02 + 14.0),
        (PAUSE, 3.0, False, 100.02 + 3.0),
        (WAITS, None, False, inf),
        (WAITS, 60.0, False, 100.02 + 60.0),
        (PAUSE, None, True, 100.0 + 14.0),
        (WAITS, None, True, 100.0 + 14.0),
        (replace(PAUSE, project_loop=3), None, False, 100.02 + 38.0),
    ],
)
def test_how_long_it_is_waited_for(made: Any, timeout: float | None, lost: bool, deadline: float) -> None:
    case = Case(made, timeout)
    if lost:
        case.wait.unacknowledged(LOST)
    else:
        case.wait.begun(100.02)
    assert case.wait.deadline == pytest.approx(deadline)
    if deadline < inf:
        assert case.result(deadline - 0.01) == (None, None)
        assert case.result(deadline + 0.01)[0] is (Outcome.UNKNOWN if lost else Outcome.TIMEOUT)


def test_the_slowest_reading_counts() -> None:
    ramp = project(step(start_frequency=100, acceleration=10, speed=300))
    case = Case(ramp)
    case.wait.begun(100.0)
    assert case.wait.deadline == pytest.approx(100.0 + 1.2 * plan(ramp).estimate.high + 2)
    assert plan(ramp).estimate.high > plan(ramp).estimate.seconds


def test_a_lost_acknowledgement_is_no_matter_when_the_notice_comes() -> None:
    case = Case()
    case.wait.unacknowledged(LOST)
    case.wait.heard(notice(110.01))
    outcome, seconds = case.result(110.01)
    assert (outcome, seconds) == (Outcome.COMPLETED, pytest.approx(10.01))
    assert "after it was sent; its acknowledgement was lost" in case.why


def test_nothing_at_all_says_what_failed() -> None:
    case = Case()
    case.wait.unacknowledged(LOST)
    case.result(200.0)
    assert case.why.endswith("it may run or not (node 1 did not answer)")


def test_a_notice_never_ends_what_is_endless() -> None:
    case = Case(replace(PAUSE, project_loop=255), timeout=1000.0)
    case.wait.begun(100.0)
    case.wait.heard(notice(1000.0))
    assert case.result(1101.0) == (Outcome.UNKNOWN, None)
    assert "never ends by itself" in case.why


def test_before_the_acknowledgement_nothing_is_said() -> None:
    case = Case(timeout=0.001)
    case.memory.stops += 1
    assert case.result(105.0) == (None, None)
