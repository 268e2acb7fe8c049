"""Everything that a line, a supply or an unlucky moment does to a run: its outcome is right, or unknown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from motorbus.core.operation import Operation, Pause
from motorbus.errors import LinkLost, MotorbusError, RequestError
from motorbus.families.stepper import driver
from motorbus.families.stepper.driver import Outcome
from motorbus.families.stepper.program.earliest import earliest
from motorbus.families.stepper.table import Step
from tests.families.stepper.runs import TURN, A, B, Running, armed, at, made

LONG = made(replace(TURN, distance=16000))
"""Ten turns in ten seconds."""


# --- the acknowledgement -------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", ["lost", "bit", "other", "late", "split"])
def test_the_notice_proves_that_a_start_was_heard_whose_acknowledgement_was_lost(fault: str) -> None:
    with armed(reply_fault=fault) as there:
        ran = there.go()
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(1.6856, abs=0.003)
        assert "its acknowledgement was lost" in ran.why
        assert (there.starts, there.owed) == (1, False)


@pytest.mark.parametrize("fault", ["doubled", "noise"])
def test_an_acknowledgement_with_something_beside_it(fault: str) -> None:
    with armed(reply_fault=fault) as there:
        assert there.go().outcome is Outcome.COMPLETED
        assert there.starts == 1


def test_a_start_that_was_not_heard_is_unknown_and_not_said_again() -> None:
    with armed(reply_fault="unheard") as there:
        ran = there.go()
        assert (ran.outcome, ran.seconds) == (Outcome.UNKNOWN, None)
        assert "it may run or not" in ran.why
        assert (there.starts, there.owed) == (1, True)


def test_one_that_waits_and_was_not_acknowledged_is_not_waited_for_without_end() -> None:
    with armed(made(replace(TURN, start_input=1)), reply_fault="unheard") as there:
        assert there.go().outcome is Outcome.UNKNOWN
        assert there.link.now() < 10


# --- the notice ------------------------------------------------------------------------------------------------


def test_a_lost_notice_is_a_timeout_at_the_deadline() -> None:
    with Running(notice_fault="lost") as there:
        began = there.link.now()
        ran = there.go()
        assert (ran.outcome, ran.seconds) == (Outcome.TIMEOUT, None)
        assert there.link.now() - began == pytest.approx(ran.predicted.high * 1.2 + 2, abs=0.1)
        assert "it may still run" in ran.why


@pytest.mark.parametrize("when", [0.0, 0.3, 1.5, 1.55])
def test_a_notice_that_comes_too_early_is_none_and_the_right_one_still_counts(when: float) -> None:
    assert when < earliest(A) * 0.98
    with Running() as there:
        ran = there.beside(at(when + 0.01, there.simulated.notice))
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(1.6836, abs=0.001)


@pytest.mark.parametrize("when", [0.1, 1.5])
def test_a_notice_that_comes_too_early_and_no_other_is_unknown(when: float) -> None:
    with Running(notice_fault="lost") as there:
        ran = there.beside(at(when, there.simulated.notice))
        assert ran.outcome is Outcome.UNKNOWN
        assert "cannot end before" in ran.why
        assert there.owed is True


def test_a_notice_while_the_project_is_read_is_another_ones() -> None:
    with Running(made(Step(output=1)), turnaround=0.01, notice_fault="lost") as there:
        ran = there.beside(at(0.005, there.simulated.notice), at(0.018, there.simulated.notice))
        assert ran.outcome is not Outcome.COMPLETED


def test_a_notice_that_waits_for_the_next_reply_comes_too_late() -> None:
    with Running(notice_fault="early") as there:
        assert there.go().outcome is Outcome.TIMEOUT
        there.simulated.switch(notice_fault="none")
        ran = there.go(stop_first=True)  # whose acknowledgement brings it
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(1.6836, abs=0.001)


def test_a_notice_that_is_later_than_the_next_start_is_too_early_for_its_end() -> None:
    """The one thing that a controller in order never does; what saves the next run is what it takes at least."""
    with Running(notice_fault="late", fault_time=6.0) as there:
        assert there.go().outcome is Outcome.TIMEOUT
        there.simulated.switch(notice_fault="none")
        there.simulated.put(1, LONG)
        ran = there.go(stop_first=True)
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(ran.predicted.seconds, abs=0.01)


# --- dumps meanwhile -----------------------------------------------------------------------------------------------


def reading(there: Running, times: int) -> Operation[None]:
    for _ in range(times):
        yield from Pause(0.3)
        try:
            yield from driver.dump(there.device, 2)
        except MotorbusError:
            continue


@pytest.mark.parametrize("dump_fault", ["none", "short", "byte"])
@pytest.mark.parametrize("distance", [56814, 43775])
def test_the_bytes_of_a_notice_inside_dumps_end_nothing(dump_fault: str, distance: int) -> None:
    with armed(LONG, dump_fault=dump_fault, notice_fault="lost") as there:
        there.simulated.put(2, replace(B.with_step(2, distance=distance), number=2))
        ran = there.beside(reading(there, 30))
        assert ran.outcome in (Outcome.TIMEOUT, Outcome.UNKNOWN)


def test_a_notice_in_the_middle_of_a_dump_may_be_lost_and_is_not_made_up() -> None:
    with Running(notice_fault="inside_dump") as there:
        there.simulated.put(2, replace(B, number=2))
        ran = there.beside(reading(there, 20))
        assert ran.outcome in (Outcome.TIMEOUT, Outcome.UNKNOWN)


def test_dumps_that_are_read_meanwhile_do_no_harm() -> None:
    with Running(LONG) as there:
        there.simulated.put(2, replace(B, number=2))
        ran = there.beside(reading(there, 40))
        assert ran.outcome is Outcome.COMPLETED


# --- supply, line, and others who start projects --------------------------------------------------------------------


@pytest.mark.parametrize("what", ["power_cycle", "unplug"])
def test_without_supply_nothing_comes(what: str) -> None:
    with Running(LONG) as there:
        ran = there.beside(at(3.0, getattr(there.simulated, what)))
        assert (ran.outcome, there.owed) == (Outcome.TIMEOUT, True)


def test_a_port_that_goes_away_is_said_at_once_and_the_project_is_owed() -> None:
    with Running(LONG) as there:
        there.link.unplug(5.0)
        with pytest.raises(LinkLost):
            there.go(watch=(1,))
        assert there.link.now() == pytest.approx(5.0, abs=0.01)
        assert (there.owed, there.simulated.moving) == (True, True)
        there.link.plug()
        with pytest.raises(RequestError, match="may still run"):
            there.go()


def test_what_another_host_has_started_ends_too_early_for_this_one() -> None:
    """A busy controller acknowledges a start and ignores it: the notice is that of the other project."""
    with Running(LONG) as there:
        there.press("FF AA 4E 01 00 00 00 00 00 00 F8")
        there.link.advance(5.0)
        ran = there.go()
        assert ran.outcome is Outcome.UNKNOWN
        assert "cannot end before" in ran.why


def test_inputs_that_cannot_be_read_do_not_end_it() -> None:
    with armed(LONG, reply_fault="other", fault_every=2) as there:
        assert there.go(watch=(1, 2)).outcome is Outcome.COMPLETED
