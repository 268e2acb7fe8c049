"""Whoever reckons where the motor stands is told by each error whether it stands there still.

An error that says so is never wrong: nothing has turned since the work began. One that comes of a motion that had
begun never says so.
"""

from __future__ import annotations

from collections.abc import Callable
from math import tau
from typing import Any

import pytest

from motorbus.core.operation import Progress
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, NotHomed, OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import Moved
from motorbus.families.stepper.driver.turning import Watch, honest
from tests.families.stepper.loans import MINE, Cut, Line1
from tests.families.stepper.partners import Partner, kept
from tests.families.stepper.test_driver_borrowing import MOVE
from tests.families.stepper.test_driver_stopping import Losing

Work = Callable[[Controller], Any]
WORKS: dict[str, Work] = {
    "move_by": lambda device: device.move_by(-tau, velocity=tau),
    "jog": lambda device: device.jog(tau, 0.5),
    "home": lambda device: device.home(deadline=1.5),
    "keep_time": lambda device: kept(device, Partner(1.0, thinks=0.01)),
    "run": lambda device: device.run(1, timeout=4.0),
}


def error_of(told: object) -> MotorbusError:
    assert isinstance(told, MotorbusError), told
    return told


def begun(line: Line1) -> bool:
    """Whether anything that moves has reached the controller."""
    return line.simulated.state.since > 0


@pytest.mark.parametrize("verb", WORKS)
def test_a_host_that_dies_says_so_only_where_it_is_so(verb: str) -> None:
    """At any request, before it has left and after: at each of the first thirty, and at some later ones."""
    whole = Line1(home_switch="never")
    whole.run(WORKS[verb])
    said = set()
    for request in (*range(min(30, whole.count)), *range(30, whole.count, max(1, whole.count // 20))):
        for sent in (False, True):
            line = Line1(home_switch="never")
            error = error_of(line.run(WORKS[verb], Cut(request, sent)))
            line.later()
            said.add(error.unmoved)
            if error.unmoved:
                assert (line.simulated.position, begun(line)) == (0, False), request
    assert said == {True, False}


@pytest.mark.parametrize("fault", ["lost", "late", "doubled", "bit", "other", "unheard"])
@pytest.mark.parametrize("every", [2, 3, 4, 5, 9])
@pytest.mark.parametrize("verb", WORKS)
def test_on_faulty_lines_it_is_never_wrong(verb: str, fault: str, every: int) -> None:
    line = Line1(home_switch="never", reply_fault=fault, fault_every=every)
    told = line.run(WORKS[verb])
    line.later()
    if isinstance(told, MotorbusError) and told.unmoved:
        assert (line.simulated.position, begun(line)) == (0, False)


@pytest.mark.parametrize(
    "work",
    [
        lambda device: device.move_by(0.0, velocity=tau),
        lambda device: device.jog(tau / 60 * 1.5, 1.0),
        lambda device: device.home(velocity=tau / 60 * 1.5),
        lambda device: kept(device, Partner(), velocity=tau / 60 / 2),
        lambda device: device.run(2),
    ],
)
def test_what_is_refused_before_has_moved_nothing(work: Work) -> None:
    error = error_of(Line1().run(work))
    assert (isinstance(error, RequestError), error.unmoved) == (True, True)


def test_a_switch_that_is_active_already_has_moved_nothing_and_one_that_does_not_come_has() -> None:
    for switch, unmoved in (("stuck", True), ("never", False)):
        error = error_of(Line1(home_switch=switch).run(WORKS["home"]))
        assert (isinstance(error, NotHomed), error.unmoved) == (True, unmoved)


def test_an_acknowledgement_that_is_lost_leaves_it_open() -> None:
    line = Line1()
    line.line = Losing(MOVE, 1)
    error = error_of(line.run(WORKS["move_by"]))
    assert (isinstance(error, OutcomeUnknown), error.unmoved) == (True, False)


def test_a_supply_that_goes_in_the_middle_leaves_it_open() -> None:
    line = Line1()

    def cut(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what.startswith("moving") and event.done > 200:
            line.react = lambda event, bus: None
            line.simulated.power_cycle()

    line.react = cut
    error = error_of(line.run(WORKS["move_by"]))
    assert (isinstance(error, OutcomeUnknown), error.unmoved) == (True, False)


def test_where_nothing_had_to_be_edited_a_power_cycle_is_not_noticed() -> None:
    """What the documentation says: then a motion that returned may have been cut short."""
    line = Line1(MINE.with_step(1, distance=400))

    def cut(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.done > 200:
            line.react = lambda event, bus: None
            line.simulated.power_cycle()

    line.react = cut
    assert isinstance(line.run(lambda device: device.run_once()), Moved)
    assert 0 < abs(line.simulated.position) < 1600


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("ended", [False, True])
@pytest.mark.parametrize("kind", [RequestError, LimitExceeded, Interrupted])
def test_what_an_error_says_by_when_it_comes(ordered: bool, ended: bool, kind: type[MotorbusError]) -> None:
    """The gate is asked last, so what it refuses has not left; any other refusal behind an order is none."""

    def raises(device: Controller) -> Any:
        watch = Watch(device)
        watch.ordered, watch.ended = ordered, ended

        def failing() -> Any:
            yield from ()
            raise kind("made up")

        return device.bus.run(honest(watch, failing()))

    error = error_of(Line1().run(raises))
    left = ordered and kind is not LimitExceeded
    assert error.unmoved == (not left and not ended)
    assert isinstance(error, OutcomeUnknown if left and kind is RequestError else kind)
