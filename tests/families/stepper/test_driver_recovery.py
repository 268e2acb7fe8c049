"""A borrow that was cut off is ended by its facts alone, and by no others."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.operation import REACHED
from motorbus.errors import OutcomeUnknown, RequestError
from motorbus.families.stepper import Controller
from tests.families.stepper.loans import MINE, Cut, Line1
from tests.families.stepper.test_borrow_cuts import jogged, wrecked
from tests.families.stepper.test_driver_borrowing import SELECT, failed, starts
from tests.families.stepper.test_driver_stopping import MOTOR, PROJECT, Losing

MOVING = Cut(8, sent=True)
"""The order to move has left."""


@pytest.fixture
def line() -> Line1:
    return wrecked(MOVING, jogged, {})


def facts_of(line: Line1) -> dict[str, Any]:
    change = line.journal.unfinished()
    assert change is not None
    return change.facts


def test_it_stops_first_and_writes_only_what_differs(line: Line1) -> None:
    assert line.run(line.recovery) == "old"
    sent = line.sent
    assert sent[:2] == [PROJECT, MOTOR]
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
        {"wanted": {"speed": 1}},
        {"wanted": {"step_11_speed": 1}},
        {"wanted": {"step_0_speed": 1}},
        {"wanted": {"step_1_colour": 1}},
    ],
)
def test_facts_of_something_else_are_refused(line: Line1, changes: dict[str, Any]) -> None:
    facts = {**facts_of(line), **changes}
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
