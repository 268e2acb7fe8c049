"""Temporary use of project 1: what the journal holds, what is refused, what is restored.

Cuts at every frame are in `test_power_cuts.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import tau
from typing import Any

import pytest

from motorbus.core.steps import JournalEntry
from motorbus.errors import MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper.parameters import Project, Step, encode_image, with_steps
from tests.families.stepper.bench import READ_1, STOP_MOTOR, STOP_PROJECT, Bench, bench, made

MINE = with_steps(
    Project(
        number=1, microsteps=8, step_angle=180, turn_distance=400, loop_first=1, loop_last=2, loop_count=3
    ),
    (
        Step(distance=7, direction=1, start_frequency=60, acceleration=40, speed=90, delay=300, output=2),
        Step(distance=50, start_frequency=50, acceleration=30, speed=120),
    ),
)
"""A project 1 in which every field that a motion changes has a value of its own."""
JOG = (tau, 0.2)


@pytest.fixture
def one() -> Iterator[Bench]:
    with bench(MINE) as found:
        yield found


def image(one: Bench) -> bytes:
    return one.simulated.store.image(1)


def states(one: Bench) -> list[str]:
    return [entry.state for entry in one.told(JournalEntry)]


def on_move(one: Bench, act: Callable[[], object]) -> None:
    """Do this when the motion request has been acknowledged."""

    def change(data: bytes) -> bytes:
        if len(data) == 6 and data[2:4] == b"\x03\x0c":
            one.line.change = lambda data: data
            act()
        return data

    one.line.change = change


def test_use_edits_moves_stops_and_restores(one: Bench) -> None:
    before = image(one)
    moved = one.device.jog(*JOG)
    assert image(one) == before
    assert moved.velocity == pytest.approx(tau)
    kinds = [frame[6:11] for frame in one.sent()]
    assert kinds == [
        "3E 01", "3E 01", "6E 01", "03 02", "03 03", "03 04", "03 05", "3E 01",
        "03 0C", "03 0D", "5E 00",
        "3E 01", "3E 01", "6E 01", "03 02", "03 03", "03 04", "03 05", "3E 01",
    ]  # fmt: skip
    assert states(one) == ["asked", "intent", "edited", "restoring", "outcome"]
    assert one.journal.unfinished() is None
    assert one.simulated.position == pytest.approx(moved.angle / tau * 1600)


def test_project_1_with_this_move_is_not_edited(one: Bench) -> None:
    one.simulated.put(1, made(Step(distance=1600, speed=60, start_frequency=400, acceleration=100)))
    one.device.move_by(tau, velocity=tau)
    assert [frame[6:11] for frame in one.sent()] == ["3E 01", "3E 01", "03 0C", "03 0D", "5E 00"]
    assert states(one) == ["asked"]


def test_journal_holds_project_1_before_the_first_edit(one: Bench) -> None:
    entries: list[tuple[JournalEntry, int]] = []
    one.react = lambda event: (
        entries.append((event, len(one.sent()))) if isinstance(event, JournalEntry) else None
    )
    one.device.jog(*JOG)
    asked, intent = entries[0], entries[1]
    assert (asked[1], intent[1]) == (0, 2), "nothing but two dumps left before"
    facts = intent[0].facts
    assert bytes.fromhex(str(facts["image"])) == encode_image(MINE)
    assert facts["changed"] == {
        "turn_distance": 1600, "step_1_distance": 320, "step_1_direction": 0, "step_1_speed": 60,
    }  # fmt: skip


def test_stop_comes_before_the_edits_where_nothing_is_acknowledged(one: Bench) -> None:
    on_move(one, lambda: setattr(one.line, "change", lambda data: b"" if data[2:4] != b"\x03\x0c" else data))
    with pytest.raises(OutcomeUnknown, match="may be turning"):
        one.device.jog(*JOG)
    after = one.sent()[9:]
    assert set(after) == {STOP_MOTOR, STOP_PROJECT}
    assert one.journal.unfinished() is not None, "project 1 is still edited"
    one.line.change = lambda data: data
    with pytest.raises(RequestError, match="the temporary use of project 1 by jog"):
        one.device.jog(*JOG)
    change = one.journal.unfinished()
    assert change is not None
    assert one.device.recover(change.verb, change.facts) == "old"
    assert image(one) == encode_image(MINE)
    assert one.journal.unfinished() is None
    one.device.jog(*JOG)


def test_supply_lost_during_the_motion_is_told(one: Bench) -> None:
    on_move(one, one.simulated.power_cycle)
    with pytest.raises(OutcomeUnknown, match="lost its supply"):
        one.device.jog(*JOG)
    assert one.journal.unfinished() is None
    assert image(one) == encode_image(MINE)


def test_controller_that_shows_what_is_stored_is_not_moved() -> None:
    with bench(MINE, read_view="stored") as one:
        with pytest.raises(VerificationFailed, match="cannot be read"):
            one.device.jog(*JOG)
        assert not [frame for frame in one.sent() if frame.startswith("FF AA 03 0C")]
        assert one.simulated.store.working == MINE, "the edits are undone though they cannot be read"
        assert one.journal.unfinished() is None


def test_use_that_would_lose_edits_is_refused(one: Bench) -> None:
    one.simulated.put(2, made(number=2))
    one.device.write(project=2, save=False, step_1_delay=1.0)
    one.sent()
    with pytest.raises(RequestError, match="project 2 that are not saved"):
        one.device.jog(*JOG)
    assert one.sent() == [READ_1] * 2
    assert one.device.read_raw("step_1_delay", project=2) == {"step_1_delay": 1000}
    one.device.write(project=2, step_1_delay=1.0)
    one.device.jog(*JOG)


def test_project_1_that_cannot_be_restored_is_not_edited(one: Bench) -> None:
    one.simulated.put(1, replace(MINE, mode4=9))
    with pytest.raises(RequestError, match="could not be restored: mode4"):
        one.device.jog(*JOG)
    assert set(one.sent()) == {READ_1}


def test_unsaved_edits_of_project_1_are_restored(one: Bench) -> None:
    one.device.write(project=1, save=False, step_2_delay=1.0)
    one.device.jog(*JOG)
    assert one.device.read_raw("step_2_delay") == {"step_2_delay": 1000}
    one.device.write(project=1, step_2_delay=1.0)
    one.simulated.power_cycle()
    assert one.device.read_raw("step_2_delay") == {"step_2_delay": 1000}


# -- recover -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def cut(one: Bench) -> tuple[Bench, str, dict[str, Any]]:
    """A host that has died while the motor turned."""
    facts: dict[str, Any] = {}

    def record(event: object) -> None:
        if isinstance(event, JournalEntry) and event.state == "intent":
            facts.update(event.facts)

    one.react = record
    on_move(one, lambda: facts.update(working=one.simulated.store.working))
    one.device.jog(*JOG)
    one.simulated.store.working = facts.pop("working")
    one.device.state.projects.clear()
    one.sent()
    return one, "jog", {**facts, "reached": ["intent", "edited"]}


def test_recover_restores_what_was_edited_and_keeps_the_rest(cut: tuple[Bench, str, dict[str, Any]]) -> None:
    one, change, facts = cut
    one.simulated.store.working = one.simulated.store.working.with_step(2, delay=5)
    assert one.device.recover(change, facts) == "old"
    assert one.sent()[:2] == [STOP_MOTOR, STOP_PROJECT]
    assert one.simulated.store.working == MINE.with_step(2, delay=5)
    assert one.device.recover(change, facts) == "old"


def test_recover_refuses_what_something_else_has_written(cut: tuple[Bench, str, dict[str, Any]]) -> None:
    one, change, facts = cut
    one.simulated.store.working = one.simulated.store.working.with_step(1, speed=7)
    with pytest.raises(RequestError, match="step_1_speed"):
        one.device.recover(change, facts)
    assert set(one.sent()) == {STOP_MOTOR, STOP_PROJECT, READ_1}


@pytest.mark.parametrize("reached", [["intent"], ["intent", "edited", "restoring"]])
def test_recover_writes_a_half_edited_project_back_in_full(
    cut: tuple[Bench, str, dict[str, Any]], reached: list[str]
) -> None:
    one, change, facts = cut
    one.simulated.store.working = one.simulated.store.working.with_step(1, speed=7).with_step(2, delay=5)
    assert one.device.recover(change, {**facts, "reached": reached}) == "old"
    assert one.simulated.store.working == MINE


def test_recover_refuses_facts_of_something_else(cut: tuple[Bench, str, dict[str, Any]]) -> None:
    one, change, facts = cut
    for verb, wrong in (
        (change, {}),
        (change, {**facts, "image": "FF"}),
        (change, {**facts, "changed": {"speed_of_light": 1}}),
        (change, {**facts, "changed": {"step_1_speed": "fast"}}),
        (change, {**facts, "order": "big"}),
        (change, {**facts, "motor": 7}),
        ("set_id", facts),
    ):
        with pytest.raises(RequestError):
            one.device.recover(verb, wrong)
    assert one.sent() == []


def test_recover_of_a_run_stops_it(one: Bench) -> None:
    one.simulated.put(2, made(number=2))
    one.device.start_project(2)
    change = one.journal.unfinished()
    assert change is not None
    assert one.device.recover(change.verb, change.facts) == "stopped"
    assert one.simulated.machine.run is None
    assert one.journal.unfinished() is None
    with pytest.raises(MotorbusError):
        one.device.recover("nothing", {})
