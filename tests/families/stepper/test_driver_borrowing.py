"""Project 1 is lent and given back: what is written for it, what refuses it, and what an error leaves."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from math import tau
from typing import Any

import pytest

from motorbus.core.steps import INTENT, OUTCOME, JournalEntry, Progress, Sleep, gather
from motorbus.errors import Interrupted, MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import jog, stop
from motorbus.families.stepper.driver.borrowing import LOST, NOTE
from motorbus.families.stepper.driver.stopping import MAY_TURN
from motorbus.families.stepper.execution import Phase
from tests.families.stepper.loans import MINE, Line1
from tests.families.stepper.test_driver_stopping import MOTOR, PROJECT, Losing

READ = "FF AA 3E 01"
SELECT = "FF AA 6E 01"
MOVE = "FF AA 03 0C"
READINGS: list[dict[str, Any]] = [
    {},
    {"select": "relabel"},
    {"select": "relabel", "selected_at_boot": 2},
    {"selected_at_boot": 3},
]
"""What nobody knows of a controller's memory, as far as a borrow can be read back."""


def turned(device: Controller) -> object:
    return device.jog(3.0, 0.5)


def starts(frames: list[str]) -> list[str]:
    return [frame[:11] for frame in frames]


def states(line: Line1) -> list[str]:
    return [one.state for one in line.events if isinstance(one, JournalEntry) and one.state != "asked"]


def failed(told: object, error: type[MotorbusError], text: str = "") -> list[str]:
    """The notes of this error, which is what came of it."""
    assert isinstance(told, error), told
    assert text in str(told)
    return list(getattr(told, "__notes__", ()))


def test_it_reads_edits_reads_moves_stops_and_brings_back() -> None:
    line = Line1()
    line.run(turned)
    sent = starts(line.sent)
    edits = [SELECT, "FF AA 03 02", "FF AA 03 03", "FF AA 03 04", "FF AA 03 05"]
    move = sent.index(MOVE)
    assert sent[:move] == [READ, READ, *edits, READ]
    assert line.sent[move + 1 : move + 3] == [MOTOR, PROJECT]
    assert [one for one in sent[move + 3 :] if one != READ] == edits
    assert sent[-1] == READ
    assert line.as_before
    assert states(line) == [INTENT, "borrowed", OUTCOME]
    assert line.journal.unfinished() is None


@pytest.mark.parametrize("options", READINGS)
def test_nothing_is_ever_saved_and_other_projects_stay(options: dict[str, Any]) -> None:
    line = Line1(**options)
    line.simulated.put(2, replace(MINE, number=2, turn_distance=77))
    stored = dict(line.simulated.store.stored)
    line.run(turned)
    assert line.as_before
    assert line.simulated.store.stored == stored


def test_what_was_edited_and_not_saved_comes_back_too() -> None:
    """Also after a power cycle in the middle of the motion, which has lost it."""
    for cycles in (False, True):
        line = Line1()
        line.simulated.store.edit("set_step_delay", {"step": 2, "delay": 4321})
        line.before = line.simulated.store.image(1)

        def cycle(event: object, bus: object, line: Line1 = line, cycles: bool = cycles) -> None:
            if cycles and isinstance(event, Progress) and event.what.startswith("moving"):
                line.simulated.power_cycle()

        line.react = cycle
        line.run(turned)
        assert line.as_before
        assert line.journal.unfinished() is None


@pytest.mark.parametrize("cleared", [False, True])
def test_a_power_cycle_meanwhile_is_told_and_nothing_need_be_written(cleared: bool) -> None:
    line = Line1(None, shipped="empty") if cleared else Line1()
    line.simulated.put(2, replace(MINE, number=2))

    def cycle(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what.startswith("moving"):
            line.simulated.power_cycle()

    line.react = cycle
    told = line.run(turned)
    assert (
        failed(told, OutcomeUnknown, "lost its supply meanwhile: where the motor stands is not known") == []
    )
    sent = starts(line.sent)
    assert set(sent[sent.index(MOVE) + 3 :]) == {READ}
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_a_power_cycle_is_told_beside_a_stop_too() -> None:
    line = Line1()
    line.interrupts = [1.0]

    def cycle(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what.startswith("moving"):
            line.simulated.power_cycle()

    line.react = cycle
    with pytest.raises(KeyboardInterrupt) as caught:
        line.run(lambda device: device.jog(tau, 30.0))
    assert caught.value.__notes__ == [LOST]


def test_what_slows_down_has_its_time_before_anything_is_edited() -> None:
    """10 ms for each 5 Hz, from 4800 Hz down to 60 Hz: a stop that is slow takes its time."""
    line = Line1(MINE.with_step(1, acceleration=5), ramp_tick_ms=10.0)
    phases: list[Phase] = []

    def look(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what == "writing project 1":
            phases.append(line.simulated.state.phase)

    def both(device: Controller) -> object:
        return device.bus.run(gather(jog(device, 3 * tau, 50.0), _stopped(device, 15.0)))

    line.react = look
    failed(line.run(both), Interrupted)
    assert set(phases) == {Phase.IDLE}
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_a_stop_after_which_nothing_can_be_read_is_not_believed() -> None:
    """Also where project 1 has to be given back: one note more says so."""
    line = Line1()
    line.line = deaf = Losing("FF AA 3E", 0)

    def lose(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what.startswith("moving"):
            deaf.times = 1_000_000

    line.react = lose
    notes = failed(line.run(turned), MotorbusError)
    assert notes[-2:] == [f"the stop was accepted, and nothing came since: {MAY_TURN}", NOTE]


def test_what_project_1_has_already_is_not_borrowed() -> None:
    line = Line1(replace(MINE, turn_distance=1600).with_step(1, direction=0, distance=1600, speed=60))
    line.run(lambda device: device.move_by(tau, velocity=tau))
    assert SELECT not in starts(line.sent)
    assert states(line) == []
    assert line.simulated.position == 1600


@pytest.mark.parametrize("read_view", ["stored"])
def test_what_cannot_be_read_back_does_not_move(read_view: str) -> None:
    line = Line1(read_view=read_view)
    working = line.simulated.store.working
    failed(line.run(turned), VerificationFailed, "nothing was moved")
    assert MOVE not in starts(line.sent)
    assert line.simulated.store.working == working
    assert line.journal.unfinished() is None


@pytest.mark.parametrize(
    "options", [{"flags_scope": "device"}, {"save_cross": "refuse"}, {"rounding": "carry"}]
)
def test_other_readings_of_the_controller_do_no_harm(options: dict[str, Any]) -> None:
    line = Line1(replace(MINE, stop_mode=1), **options)
    line.run(lambda device: device.jog(tau, 0.5))
    assert (line.simulated.position, line.as_before, line.journal.unfinished()) == (800, True, None)


def test_a_cleared_project_1_is_cleared_again() -> None:
    line = Line1(None, shipped="empty")
    failed(line.run(turned), RequestError, "no project says how many pulses")
    assert set(starts(line.sent)) == {READ, "FF AA 3E 02", "FF AA 3E 03", "FF AA 3E 04"}
    line.simulated.put(3, replace(MINE, number=3))
    line.run(lambda device: device.jog(tau, 0.5))
    assert line.simulated.position == 800
    assert line.simulated.store.image(1) == bytes(220)
    assert line.journal.unfinished() is None


def test_a_project_1_that_no_command_could_bring_back_is_not_borrowed() -> None:
    for project in (replace(MINE, total_steps=0), replace(MINE, turn_distance=0)):
        line = Line1(project)
        line.simulated.put(2, MINE)
        failed(line.run(turned), RequestError, "could not be given back")
        assert {frame[:8] for frame in line.sent} == {"FF AA 3E"}
        assert line.as_before


def test_unsaved_edits_of_another_project_are_not_lost() -> None:
    line = Line1()

    def editing(device: Controller) -> object:
        device.memory.unsaved = replace(MINE, number=2)
        return turned(device)

    failed(line.run(editing), RequestError, "project 2 has edits that were not saved")
    assert set(starts(line.sent)) == {READ}


def test_a_project_that_may_run_is_not_stopped_half_way() -> None:
    line = Line1()

    def owing(device: Controller) -> object:
        device.memory.owed = True
        return turned(device)

    failed(line.run(owing), RequestError, "may still run")
    assert line.sent == []


def test_a_lost_acknowledgement_of_the_order_means_stop() -> None:
    line = Line1()
    line.line = Losing("FF AA 03 0C", 1)
    failed(line.run(turned), OutcomeUnknown)
    assert (line.as_before, line.at_rest, line.journal.unfinished()) == (True, True, None)
    assert line.sent[(move := starts(line.sent).index(MOVE)) + 1 : move + 3] == [MOTOR, PROJECT]


@pytest.mark.parametrize("lost", ["FF AA 5E", "FF AA 03 0D"])
def test_nothing_is_edited_while_the_motor_may_turn(lost: str) -> None:
    line = Line1()
    line.line = Losing(lost)
    assert failed(line.run(turned), OutcomeUnknown, "the motor may be turning") == [NOTE]
    sent = starts(line.sent)
    assert set(sent[sent.index(MOVE) + 1 :]) == {"FF AA 5E 00", "FF AA 03 0D"}
    assert not line.as_before
    line.line = None
    failed(line.run(turned), RequestError, "the borrow of project 1 (for jog)")
    assert line.sent == []
    assert line.run(line.recovery) == "old"
    assert line.as_before


@pytest.mark.parametrize("reply", ["FF AA 6E", "FF AA 03 02", "FF AA 03 05"])
def test_an_edit_that_is_not_acknowledged_moves_nothing(reply: str) -> None:
    """The bus says it three times; the fourth, which brings it back, is heard."""
    line = Line1()
    line.line = Losing(reply, 3)
    failed(line.run(turned), OutcomeUnknown)
    assert MOVE not in starts(line.sent)
    assert MOTOR not in line.sent
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_giving_back_is_tried_again() -> None:
    line = Line1()
    lossy = Losing("FF AA 6E", 0)
    line.line = lossy

    def lose(event: object, bus: object) -> None:
        if isinstance(event, Progress) and event.what.startswith("moving"):
            lossy.times = 6

    line.react = lose
    line.run(turned)
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_two_borrows_come_one_after_the_other() -> None:
    line = Line1()

    def both(device: Controller) -> object:
        other = Controller(device.bus)
        return device.bus.run(gather(jog(device, tau, 0.5), jog(other, -tau, 0.25)))

    line.run(both)
    assert line.simulated.position == 400
    sent = starts(line.sent)
    assert sent.count(MOVE) == 2
    assert line.sent.index(PROJECT) < len(sent) - 1 - sent[::-1].index(MOVE)
    assert line.as_before


async def _stopped(device: Controller, moment: float) -> object:
    await Sleep(moment)
    return await stop(device)


@pytest.mark.parametrize("moment", [0.001, 0.01, 0.4])
def test_a_stop_of_somebody_else_ends_it(moment: float) -> None:
    """While it is being edited the order does not leave any more; while it moves the wait is over."""
    line = Line1()

    def both(device: Controller) -> object:
        other = Controller(device.bus)
        return device.bus.run(gather(jog(device, tau, 50.0), _stopped(other, moment)))

    failed(line.run(both), Interrupted, "the motion was stopped")
    assert (MOVE in starts(line.sent)) == (moment == 0.4)
    assert line.now < 3.0
    assert (line.as_before, line.at_rest, line.journal.unfinished()) == (True, True, None)


def test_an_emergency_stop_at_any_event_and_it_is_given_back_all_the_same() -> None:
    for at in count():
        line = Line1()
        seen: list[object] = []

        def strike(event: object, bus: Any, seen: list[object] = seen, at: int = at) -> None:
            seen.append(event)
            if len(seen) == at + 1:
                bus.estop()

        line.react = strike
        told = line.run(turned)
        line.later(1.0)
        assert (line.as_before, line.at_rest, line.journal.unfinished()) == (True, True, None), at
        if len(seen) <= at:
            break
        if not isinstance(told, MotorbusError):
            assert states(line)[-1] == OUTCOME, "it came after the motion"
    assert at > 20


def test_a_full_disk_lets_nothing_begin() -> None:
    line = Line1()

    def full(event: object) -> None:
        if isinstance(event, JournalEntry) and event.state == INTENT:
            raise OSError("no space left on device")

    def refusing(device: Any) -> object:
        device.bus.journal = full
        with pytest.raises(OSError, match="no space"):
            turned(device)
        return None

    line.run(refusing)
    assert MOVE not in starts(line.sent)
    assert line.as_before


def test_a_bus_without_a_journal_lends_nothing() -> None:
    line = Line1()

    def refusing(device: Any) -> object:
        device.bus.journal = device.bus.report = None
        return turned(device)

    failed(line.run(refusing), RequestError, "keeps no journal")
    assert line.sent == []


def test_a_project_is_as_wanted_under_every_reading_of_its_memory() -> None:
    for options in READINGS:
        line = Line1(**options)
        line.run(lambda device: device.move_by(-2 * tau, velocity=tau))
        assert line.simulated.position == -3200, options


def test_the_order_of_bytes_in_dumps_is_heeded() -> None:
    line = Line1(dump_order="big")
    line.settings = {"dump_order": "big"}
    line.run(lambda device: device.jog(tau, 0.5))
    assert line.simulated.position == 800
    assert line.as_before
