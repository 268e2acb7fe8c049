"""A borrow that was cut off is ended by its facts alone, and by no others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import tau
from typing import Any

import pytest

from motorbus.core.steps import REACHED, Progress
from motorbus.errors import LinkLost, OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller
from motorbus.families.stepper.execution import Phase
from tests.families.stepper.loans import MINE, Cut, Line1
from tests.families.stepper.test_driver_borrowing import SELECT, failed, starts
from tests.families.stepper.test_driver_stopping import MOTOR, PROJECT, Losing

MOVING = Cut(8, sent=True)
"""The order to move has left."""


def jogged(device: Controller) -> object:
    return device.jog(tau, 0.5)


def wrecked(cut: Cut, work: Callable[[Controller], object], options: dict[str, Any]) -> Line1:
    """The line after a host has died so, and the time has passed in which the motor comes to its end."""
    line = Line1(**options)
    result = line.run(work, cut)
    assert isinstance(result, LinkLost), result
    line.later()
    assert line.at_rest, cut
    return line


@pytest.fixture
def line() -> Line1:
    return wrecked(MOVING, jogged, {})


def facts_of(line: Line1) -> dict[str, Any]:
    change = line.journal.unfinished()
    assert change is not None
    return change.facts


COMMANDS: dict[str, Callable[[Controller], object]] = {
    "jog": jogged,
    "move_by": lambda device: device.move_by(-tau, velocity=tau),
    "home": lambda device: device.home(velocity=tau, deadline=5.0),
    "run_once": lambda device: device.run_once(),
    "jog_forward": lambda device: device.jog_forward(0.1),
    "run": lambda device: device.run(1),
    "write": lambda device: device.write(step_1_delay=0.5),
    "select": lambda device: device.select(2),
    "save": lambda device: device.save(1, expert=True),
    "clear": lambda device: device.clear(2),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_command_is_refused_while_project_1_is_borrowed(line: Line1, command: str) -> None:
    failed(line.run(COMMANDS[command]), RequestError, "the borrow of project 1 (for jog)")
    assert line.sent == []
    assert f"motorbus recover {line.journal.bus}" in line.journal.warning()


def test_it_stops_first_and_writes_only_what_differs(line: Line1) -> None:
    assert line.run(line.recovery) == "old"
    sent = line.sent
    assert sent[:2] == [MOTOR, PROJECT]
    assert [one for one in starts(sent) if one in (SELECT, "FF AA 03 02")] == [SELECT, "FF AA 03 02"]
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_after_a_power_cycle_nothing_is_written(line: Line1) -> None:
    line.simulated.power_cycle()
    assert line.run(line.recovery) == "old"
    assert {one[:8] for one in line.sent[2:]} == {"FF AA 3E"}


def test_it_is_told_by_a_journal_that_knows_nothing_of_it(line: Line1) -> None:
    """The adapter has another name since, and so another journal: dying in the middle leaves a whole record there."""
    facts = facts_of(line)
    line.journal.forget()
    line.run(lambda device: device.recover("jog", facts), Cut(4))
    assert {**facts_of(line), REACHED: None} == {**facts, REACHED: None}
    assert facts_of(line)[REACHED] == ["intent", "borrowed", "recovering"]
    assert line.run(line.recovery) == "old"
    assert line.as_before


def test_nothing_is_written_while_the_motor_may_turn(line: Line1) -> None:
    line.line = Losing("FF AA 5E")
    failed(line.run(line.recovery), OutcomeUnknown, "may be turning")
    assert SELECT not in starts(line.sent)
    assert line.journal.unfinished() is not None


def test_alone_makes_no_difference(line: Line1) -> None:
    facts = facts_of(line)
    assert line.run(lambda device: device.recover("jog", facts, alone=True)) == "old"
    assert line.as_before


@pytest.mark.parametrize(
    "changes",
    [
        {"image": "00"},
        {"image": 7},
        {"image": "xx"},
        {"order": "middle"},
        {"wanted": None},
        {"wanted": {"step_1_speed": 1.5}},
        {"wanted": {"step_1_speed": True}},
        {"wanted": {"step_1_speed": "90"}},
        {"wanted": {"step_1_acceleration": -5}},
        {"wanted": {"step_1_acceleration": 10**9}},
        {"wanted": [1]},
        {"reached": 7},
        {"wanted": {"speed": 1}},
        {"wanted": {"step_11_speed": 1}},
        {"wanted": {"step_0_speed": 1}},
        {"wanted": {"step_1_colour": 1}},
    ],
)
def test_facts_of_something_else_are_refused(line: Line1, changes: dict[str, Any]) -> None:
    facts = {**facts_of(line), **changes}
    line.journal.forget()
    failed(line.run(lambda device: device.recover("jog", facts)), RequestError)
    assert line.sent == []


def test_a_change_of_another_family_is_refused(line: Line1) -> None:
    facts = facts_of(line)
    failed(
        line.run(lambda device: device.recover("set_id", facts)), RequestError, "not the facts of a borrow"
    )
    failed(
        line.run(lambda device: device.recover("jog", {"node": 3, "new": 7})), RequestError, "not the facts"
    )
    assert line.sent == []


def test_another_order_of_bytes_is_refused(line: Line1) -> None:
    line.settings = {"dump_order": "big"}
    failed(line.run(line.recovery), RequestError, "dump_order=little")
    assert line.sent == []


def test_a_cleared_project_1_comes_back_cleared() -> None:
    line = Line1(None, shipped="empty")
    line.simulated.put(2, MINE)
    line.run(jogged, Cut(16))
    assert line.simulated.store.image(1) != bytes(220)
    assert line.run(line.recovery) == "old"
    assert (line.as_before, line.simulated.store.image(1)) == (True, bytes(220))


def test_there_is_nothing_to_do_twice(line: Line1) -> None:
    facts = facts_of(line)

    def twice(device: Controller) -> tuple[str, str]:
        return device.recover("jog", facts), device.recover("jog", facts)

    assert line.run(twice) == ("old", "old")
    assert line.as_before


def test_another_motor_is_refused_for_nothing_would_stop_this_one() -> None:
    line = Line1(motor=5)
    line.settings = {"motor": 5}
    line.run(jogged, MOVING)
    line.settings = {}
    failed(line.run(line.recovery), RequestError, "motor=5")
    assert line.sent == []
    line.settings = {"motor": 5}
    line.later()
    assert line.run(line.recovery) == "old"
    assert line.as_before


WORK = replace(MINE, project_loop=5).with_step(2, delay=999).with_step(1, distance=123)


@pytest.mark.parametrize("saved", [False, True])
def test_what_somebody_has_written_since_is_not_overwritten(line: Line1, saved: bool) -> None:
    if saved:
        line.simulated.power_cycle()
    line.simulated.put(1, WORK)
    image = line.simulated.store.image(1)
    told = line.run(line.recovery)
    failed(
        told,
        RequestError,
        "somebody has written project 1 since it was borrowed: project_loop, step_1_distance, ",
    )
    assert {one[:8] for one in line.sent} == {"FF AA 03", "FF AA 5E", "FF AA 3E"}
    assert line.simulated.store.image(1) == image
    assert line.journal.unfinished() is not None


@pytest.mark.parametrize("edits", [1, 2, 3, 4, 5, 30])
def test_another_project_under_this_number_is_this_borrow_s_own_work(edits: int) -> None:
    """Selecting has left the numbers of project 2 in place, and the host died before it has written all of its own."""
    line = Line1(select="relabel", selected_at_boot=2)
    other = replace(WORK, number=2, turn_distance=77)
    line.simulated.put(2, other)
    stored = dict(line.simulated.store.stored)
    line.run(jogged, Cut(2 + edits))
    if edits > 1:
        assert line.simulated.store.image(1)[: len(line.before)] != line.before
    assert line.run(line.recovery) == "old"
    assert line.as_before
    assert line.simulated.store.stored == stored


def test_what_turns_still_when_the_next_host_comes_has_its_time_to_slow_down() -> None:
    line = Line1(MINE.with_step(1, acceleration=5), ramp_tick_ms=10.0)
    line.run(lambda device: device.jog(3 * tau, 50.0), Cut(8, sent=True))
    line.later(15.0)
    assert not line.at_rest
    phases: list[Phase] = []

    def look(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what == "writing project 1":
            phases.append(line.simulated.state.phase)

    line.react = look
    assert line.run(line.recovery) == "old"
    assert set(phases) == {Phase.IDLE}
