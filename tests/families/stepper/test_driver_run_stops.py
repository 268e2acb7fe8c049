"""What ends a run before its time: stops of this host, of a button, of an emergency; and callers that go."""

from __future__ import annotations

from dataclasses import replace

import pytest

from motorbus.errors import Interrupted, OutcomeUnknown, RequestError
from motorbus.families.stepper import driver
from motorbus.families.stepper.driver import Estimated, Outcome
from tests.families.stepper.runs import READ_1, START_1, STOPS, TURN, Running, later, made


@pytest.mark.parametrize("stop_mode", [0, 1])
@pytest.mark.parametrize("notice", [False, True])
@pytest.mark.parametrize("when", [0.1, 1.0, 8.0])
def test_a_stop_by_another_operation_is_no_end_of_its_own(stop_mode: int, notice: bool, when: float) -> None:
    """Also where the device says its notice after a stop, before both commands are acknowledged or long after."""
    slow = replace(TURN, distance=16000, acceleration=1, delay=600_000, start_input=0)
    with Running(made(replace(slow, stop_input=1), stop_mode=stop_mode), notice_on_stop=notice) as there:
        ran = there.beside(later(when, lambda: driver.stop(there.device)), timeout=60.0)
        assert (ran.outcome, ran.seconds) == (Outcome.STOPPED, None)
        assert there.owed is False


def test_a_stop_before_it_has_left_withdraws_it() -> None:
    with Running() as there:
        with pytest.raises(Interrupted, match="a stop came in between"):
            there.beside(later(0.001, lambda: driver.stop(there.device)))
        assert (there.starts, there.owed) == (0, False)


def test_a_stop_that_nobody_accepts_leaves_it_running() -> None:
    with Running(made(replace(TURN, distance=16000))) as there:

        async def stop() -> object:
            there.simulated.switch(reply_fault="lost")
            try:
                return await driver.stop(there.device)
            except OutcomeUnknown as error:
                return error

        ran = there.beside(later(1.0, stop))
        assert ran.outcome is Outcome.TIMEOUT  # it was heard all the same, but that nobody knows
        assert there.owed is True


@pytest.mark.parametrize(
    ("watch", "outcome"), [((4,), Outcome.STOPPED), ((1, 4), Outcome.STOPPED), ((), Outcome.TIMEOUT)]
)
def test_input_4_stops_it_and_who_watches_knows(watch: tuple[int, ...], outcome: Outcome) -> None:
    with Running(made(replace(TURN, distance=16000))) as there:
        there.simulator.press(4, True, 3.0)
        assert there.go(watch=watch).outcome is outcome
        assert there.owed is True


def test_input_4_that_was_active_before_has_stopped_nothing() -> None:
    with Running() as there:
        there.simulated.set_input(4, True)
        there.simulator.press(4, False, 1.0)
        assert there.go(watch=(4,)).outcome is Outcome.COMPLETED


def test_stop_first_stops_what_may_run_and_waits_until_it_has_slowed_down() -> None:
    slow = made(replace(TURN, distance=16000, acceleration=1), stop_mode=0)
    with Running(slow, notice_fault="lost", ramp_tick_ms=1.0) as there:
        assert there.go(timeout=4.0).outcome is Outcome.TIMEOUT
        there.simulated.switch(notice_fault="none")
        there.sent()
        ran = there.go(stop_first=True)
        assert there.sent() == [*STOPS, READ_1, READ_1, START_1]
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(ran.predicted.seconds, abs=0.01)


# --- emergency stop, interruption, a listener that fails ----------------------------------------------------


def test_an_emergency_stop_ends_the_wait_and_wants_a_stop_before_the_next_run() -> None:
    with Running(made(replace(TURN, distance=16000))) as there:

        def press(event: object) -> None:
            if isinstance(event, Estimated) and event.at > 3.0:
                there.bus.estop()

        there.bus.report = press
        with pytest.raises(Interrupted, match="emergency stop"):
            there.go()
        assert there.owed is True
        there.bus.report = there.events.append
        with pytest.raises(RequestError, match="may still run"):
            there.go()
        there.bus.reset()
        there.device.stop()
        assert there.go().outcome is Outcome.COMPLETED


@pytest.mark.parametrize("interruption", [KeyboardInterrupt(), ValueError("the listener's own")])
def test_a_caller_that_goes_leaves_it_running_and_is_told_so(interruption: BaseException) -> None:
    with Running(made(replace(TURN, distance=16000))) as there:

        def go(event: object) -> None:
            if isinstance(event, Estimated) and event.at > 3.0:
                raise interruption

        there.bus.report = go
        with pytest.raises(type(interruption)) as raised:
            there.go()
        assert "project 1 was started and goes on: nothing was sent to stop it" in raised.value.__notes__
        assert there.sent() == [READ_1, READ_1, START_1]
        assert there.simulated.moving
        assert there.owed is True
