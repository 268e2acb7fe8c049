"""A project that was started and may still run is known to the next program that opens the line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

import motorbus
from motorbus import session
from motorbus.core.steps import INTENT, OUTCOME, JournalEntry
from motorbus.errors import Interrupted, LinkError, OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller, driver
from motorbus.families.stepper.driver import Outcome, Promise, Unrecorded
from motorbus.journal import Change
from motorbus.simulation.named import Simulation
from tests.families.stepper.runs import STOPS, TURN, A, B, made


@contextmanager
def opened(simulation: Simulation) -> Iterator[Controller]:
    with motorbus.open(simulation.url) as bus:
        yield Controller(bus)


@contextmanager
def started(project: int = 2) -> Iterator[Simulation]:
    """A program has started a project and gone; it runs 41 s, project 1 takes 1.7 s."""
    with motorbus.simulate("stepper") as simulation:
        simulation[1].put(1, A)
        simulation[1].put(2, replace(B, number=2, steps=tuple(replace(s, start_input=0) for s in B.steps)))
        with opened(simulation) as controller:
            controller.start_project(project)
        yield simulation


def unfinished(controller: Controller) -> Change | None:
    return session.unfinished(controller.bus)  # type: ignore[arg-type]


def test_the_next_program_is_told_and_starts_nothing() -> None:
    with started() as simulation, opened(simulation) as controller:
        (warning,) = controller.bus.warnings  # type: ignore[attr-defined]
        assert warning.startswith("the run of project 2, begun 20")
        assert warning.endswith(f"is unfinished; `motorbus stop {simulation.url}` ends it")
        for start in (controller.run, controller.start_project):
            with pytest.raises(RequestError, match="the run of project 2, .* is unfinished") as refused:
                start(1)
            assert "nothing has told that it has ended" in refused.value.cause
        with pytest.raises(RequestError, match="the run of project 2"):
            controller.jog(6.0, 0.5)
        assert simulation[1].moving


@pytest.mark.parametrize("how", ["stop", "stop_first", "recover"])
def test_a_stop_settles_it(how: str) -> None:
    with started() as simulation, opened(simulation) as controller:
        if how == "stop":
            controller.stop()
        change = unfinished(controller)
        if how == "recover":
            assert change is not None
            assert controller.recover(change.verb, change.facts) == "stopped"
        ran = controller.run(1, stop_first=how == "stop_first")
        assert ran.outcome is Outcome.COMPLETED
        assert unfinished(controller) is None


def test_a_run_whose_end_came_leaves_nothing_behind() -> None:
    with motorbus.simulate("stepper") as simulation:
        with opened(simulation) as controller:
            assert controller.run(1).outcome is Outcome.COMPLETED
            assert unfinished(controller) is None
        with opened(simulation) as controller:
            assert controller.bus.warnings == ()  # type: ignore[attr-defined]


def test_a_timeout_is_remembered_and_a_start_that_never_left_is_not() -> None:
    with motorbus.simulate("stepper") as simulation:
        simulation[1].put(2, made(replace(TURN, start_input=1), number=2))
        with opened(simulation) as controller:
            with pytest.raises(RequestError, match="has no steps"):
                controller.run(3)
            assert unfinished(controller) is None
            assert controller.run(2, timeout=1.0).outcome is Outcome.TIMEOUT
        with opened(simulation) as controller:
            change = unfinished(controller)
            assert change is not None
            assert (change.verb, change.facts["project"]) == ("run", 2)
            assert controller.run(1, stop_first=True).outcome is Outcome.COMPLETED


def test_a_stop_goes_through_whatever_else_is_unfinished() -> None:
    """The journal of a borrow is none of its business."""
    with motorbus.simulate("stepper") as simulation, opened(simulation) as controller:
        journal = controller.bus.journal  # type: ignore[attr-defined]
        journal(JournalEntry("jog", INTENT, {"node": 1, "image": "00"}))
        trace = controller.bus.trace.subscribe()  # type: ignore[attr-defined]
        controller.stop()
        sent = [r.data.hex(" ").upper() for r in trace if r.direction == "tx"]
        assert sent == STOPS
        change = unfinished(controller)
        assert change is not None
        assert change.verb == "jog"


def test_a_start_that_a_latched_bus_refuses_never_was() -> None:
    with motorbus.simulate("stepper") as simulation, opened(simulation) as controller:
        controller.ping()
        bus = controller.bus
        bus.estop()  # type: ignore[attr-defined]
        for start in (controller.run, controller.start_project):
            with pytest.raises(Interrupted):
                start(1)
            assert (unfinished(controller), controller.memory.owed) == (None, False)
        bus.reset()  # type: ignore[attr-defined]
        assert controller.run(1).outcome is Outcome.COMPLETED


def test_reading_goes_on_beside_a_run_and_editing_does_not() -> None:
    with started() as simulation, opened(simulation) as controller:
        assert controller.backup().projects == (1, 2, 3, 4)
        with pytest.raises(RequestError, match="the run of project 2"):
            controller.write(project=1, step_1_delay=0.5)


def test_a_journal_that_cannot_be_written_is_told_and_stops_no_stop() -> None:
    told: list[object] = []
    with motorbus.simulate("stepper") as simulation, opened(simulation) as controller:

        def full(event: object) -> None:
            told.append(event)
            if isinstance(event, JournalEntry) and event.state == OUTCOME:
                raise LinkError("no space left")

        assert controller.bus.run(driver.run(controller, 1), full).outcome is Outcome.COMPLETED  # type: ignore[call-arg]
        assert controller.bus.run(driver.stop(controller), full) is Promise.STOP_ACCEPTED  # type: ignore[call-arg]
    assert [one for one in told if isinstance(one, Unrecorded)] == [
        Unrecorded("completed", "no space left"),
        Unrecorded("stopped", "no space left"),
    ]


def test_a_motion_whose_stop_was_not_accepted_is_not_forgotten() -> None:
    with motorbus.simulate("stepper", home_switch="never", deaf_while_moving=True) as simulation:
        simulation[1].put(1, A)
        with opened(simulation) as controller:
            with pytest.raises(OutcomeUnknown, match="may be turning"):
                controller.home(deadline=5.0)
            simulation[1].switch(deaf_while_moving=False)
            assert simulation[1].moving
            works: tuple[Callable[[], object], ...] = (
                lambda: controller.write(project=1, step_1_delay=0.5),
                lambda: controller.jog(6.0, 0.5),
                lambda: controller.select(1),
            )
            for work in works:
                with pytest.raises(RequestError, match="a move may not be over"):
                    work()
            controller.stop()
            controller.write(project=1, step_1_delay=0.5)
