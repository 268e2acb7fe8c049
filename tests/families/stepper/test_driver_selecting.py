"""Selecting, saving and clearing by themselves: guarded, read before, read after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from motorbus.core.steps import ASKED, JournalEntry, catch
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper import Backup, Controller, Program
from motorbus.families.stepper.driver.selecting import EditsLost, clear, is_blank, select
from motorbus.families.stepper.driver.writing import Proof
from motorbus.families.stepper.table import Project, decode_image
from tests.families.stepper.bench import Tampering, bench
from tests.families.stepper.written import KINDS, LONGER, PICK, named, program, stored

kinds = pytest.mark.parametrize("kind", KINDS, ids=named)


class Losing(Tampering):
    """Swallows replies that begin so, as often as said."""

    def __init__(self, begin: str, times: int) -> None:
        super().__init__()
        self.begin, self.times = bytes.fromhex(begin), times

    def change(self, data: bytes, number: int) -> bytes:
        if data.startswith(self.begin) and self.times:
            self.times -= 1
            return b""
        return data


# -- select ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["little", "big"])
def test_a_project_is_selected_with_the_steps_it_has(order: str) -> None:
    with bench(dump_order=order) as there:
        there.simulated.put(2, PICK)
        slots = dict(there.simulated.store.stored)
        there.sent()
        assert there.device.select(2) == 3
        assert [frame[:14] for frame in there.sent()] == ["FF AA 3E 02 00"] * 2 + [
            "FF AA 6E 02 03",
            "FF AA 3E 02 00",
        ]
        assert there.simulated.store.selected == 2
        assert there.simulated.store.stored == slots
        assert there.simulated.store.working == slots[2]


def test_a_cleared_one_is_not_selected() -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="would give it a step"):
            there.device.select(3)
        assert there.simulated.store.selected == 1


def test_one_that_keeps_another_projects_numbers_is_told() -> None:
    with bench(select="relabel") as there:
        there.simulated.put(2, PICK)
        with pytest.raises(VerificationFailed, match="reads as project 1 does") as told:
            there.device.select(2)
        assert "save nothing now" in told.value.advice
        assert stored(there.simulated, 2) == PICK


def test_edits_that_selecting_loses_are_told_and_no_error() -> None:
    told: list[object] = []
    with bench() as there:
        there.simulated.put(2, PICK)
        there.device.write(project=2, step_1_delay=0.75, save=False)
        assert there.bus.run(select(there.device, 2), told.append) == PICK.total_steps
        (lost,) = [one for one in told if isinstance(one, EditsLost)]
        assert lost.project == 2
        assert [(one.name, one.before) for one in lost.changes] == [("step_1_delay", 0.75)]
        assert decode_image(there.simulated.store.working) == replace(PICK, number=2)
        with pytest.raises(RequestError, match="left unsaved"):
            there.device.save(2)


@pytest.mark.parametrize("project", [0, 5, -1, "2", True, 1.0, None])
@pytest.mark.parametrize("verb", ["select", "save", "clear"])
def test_there_are_four_projects(verb: str, project: Any) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="there is no project"):
            getattr(there.device, verb)(project)
        assert there.sent() == []


# -- save --------------------------------------------------------------------------------------------------------------


@kinds
def test_what_was_not_saved_is_saved(kind: dict[str, Any]) -> None:
    with bench(**kind) as there:
        there.device.write_project(program(PICK), save=False)
        told = there.device.save(2)
        assert (told.project, told.saved) == (2, True)
        assert told.proof is (Proof.STORED if kind["read_view"] == "stored" else Proof.ACKNOWLEDGED)
        assert stored(there.simulated, 2) == PICK


def test_saving_is_all_of_its_commands_and_four_dumps() -> None:
    with bench() as there:
        there.device.write_project(program(PICK), save=False)
        told = there.device.save(2)
        assert (told.commands, told.dumps) == (78 + 1, 4)


def test_what_went_with_the_supply_is_written_again_and_no_other_project_stored() -> None:
    with bench() as there:
        there.device.write_project(program(PICK), save=False)
        there.simulated.power_cycle()
        assert there.device.save(2).saved
        assert stored(there.simulated, 2) == PICK


def test_what_nobody_edited_here_is_not_saved() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        there.device.write_project(program(replace(LONGER, number=3)), save=False)
        for project in (1, 2):
            with pytest.raises(RequestError, match="left unsaved"):
                there.device.save(project)
        assert there.device.save(3).saved
        with pytest.raises(RequestError, match="left unsaved"):
            there.device.save(3)
        assert stored(there.simulated, 2) == PICK


def test_edits_that_another_selection_has_lost_are_not_saved() -> None:
    with bench() as there:
        there.device.write_project(program(PICK), save=False)
        there.device.write_project(program(replace(LONGER, number=3)))
        with pytest.raises(RequestError, match="left unsaved"):
            there.device.save(2)
        assert stored(there.simulated, 2) == Project()


def test_an_expert_saves_what_is_there() -> None:
    with bench() as there:
        there.press("FF AA 03 07 F4 01 00 00 00 01 A9")
        assert there.device.save(1, expert=True).saved
        assert stored(there.simulated, 1).step(1).delay == 500


@pytest.mark.parametrize("reading", ["warn", "allow", "refuse"])
def test_an_expert_who_stores_another_project_is_told(reading: str) -> None:
    with bench(save_cross=reading) as there:
        there.simulated.put(2, PICK)
        told = there.run(catch(_saved(there.device, 2)))
        assert isinstance(told, OutcomeUnknown if reading == "refuse" else VerificationFailed)
        assert (stored(there.simulated, 2) == PICK) is (reading == "refuse")


def _saved(device: Any, project: int) -> Any:
    return type(device).save.function(device, project, expert=True)


def test_an_experts_save_that_is_not_acknowledged_is_not_said_again() -> None:
    with bench(line=Losing("FF AA 2E", 1)) as there:
        with pytest.raises(OutcomeUnknown) as told:
            there.device.save(1, expert=True)
        assert sum(frame.startswith("FF AA 2E") for frame in there.sent()) == 1
        assert "was being saved" in told.value.__notes__[0]


# -- clear -------------------------------------------------------------------------------------------------------------


@kinds
def test_a_project_is_cleared_and_what_it_had_is_given_back(kind: dict[str, Any]) -> None:
    with bench(**kind) as there:
        there.device.write_project(program(PICK))
        image = there.device.clear(2)
        again = Program.from_dump(image, order=there.device.order)
        assert again.project == PICK
        assert is_blank(stored(there.simulated, 2))
        assert there.device.write_project(again).saved
        assert stored(there.simulated, 2) == PICK


def test_what_is_clear_is_not_cleared() -> None:
    with bench() as there:
        assert there.device.clear(3) == bytes(220)
        assert [frame[:8] for frame in there.sent()] == ["FF AA 3E"] * 2


def test_project_1_is_for_experts() -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="jog, single move and homing"):
            there.device.clear(1)
        assert there.sent() == []
        assert there.device.clear(1, expert=True)[1] == 1
        assert stored(there.simulated, 1) == Project()


def test_a_clear_whose_acknowledgement_is_lost_is_said_again() -> None:
    with bench(line=Losing("FF AA 1E", 1)) as there:
        there.device.write_project(program(PICK))
        there.sent()
        there.device.clear(2)
        assert sum(frame.startswith("FF AA 1E") for frame in there.sent()) == 2
        assert stored(there.simulated, 2) == Project()


def test_a_clear_that_is_never_acknowledged_is_not_known() -> None:
    with bench(line=Losing("FF AA 1E", 5)) as there:
        there.simulated.put(2, PICK)
        with pytest.raises(OutcomeUnknown) as told:
            there.device.clear(2)
        assert "may hold what it held, or nothing" in told.value.__notes__[0]


class Unclear(Tampering):
    """The clear is acknowledged and not carried out: dumps go on showing the same."""

    def __init__(self) -> None:
        super().__init__()
        self.first = b""

    def change(self, data: bytes, number: int) -> bytes:
        if len(data) == 226:
            self.first = self.first or data
            return self.first
        return data


def test_a_clear_that_changes_nothing_is_told() -> None:
    with bench(line=Unclear()) as there:
        there.simulated.put(2, PICK)
        with pytest.raises(VerificationFailed, match="does not read as cleared"):
            there.device.clear(2)


def test_edits_that_were_cleared_are_not_owed() -> None:
    with bench() as there:
        there.device.write_project(program(PICK), save=False)
        there.device.clear(2)
        with pytest.raises(RequestError, match="left unsaved"):
            there.device.save(2)


@pytest.mark.parametrize("fault", ["lost", "unheard", "late", "doubled", "bit", "other", "split", "noise"])
@pytest.mark.parametrize("every", [1, 2, 3])
def test_a_clear_among_faults_is_done_or_told(fault: str, every: int) -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        there.simulated.switch(reply_fault=fault, fault_every=every)
        told = there.run(catch(clear(there.device, 2)))
        held = stored(there.simulated, 2)
        assert held == Project() or (isinstance(told, MotorbusError) and held == PICK)


def test_a_controller_that_is_gone_is_an_error() -> None:
    with bench() as there:
        there.simulated.unplug()
        for verb in (there.device.select, there.device.clear):
            with pytest.raises(NoReply):
                verb(2)


WRITES: list[Callable[[Controller], object]] = [
    lambda device: device.write_project(program(PICK)),
    lambda device: device.write(step_1_delay=0.5),
    lambda device: device.select(2),
    lambda device: device.save(1, expert=True),
    lambda device: device.clear(2),
    lambda device: device.restore(Backup(dumps={2: program(PICK).dump()})),
]


@pytest.mark.parametrize("write", WRITES)
def test_nothing_is_written_while_project_1_is_lent(write: Callable[[Controller], object]) -> None:
    with bench() as there:
        there.simulated.put(2, LONGER)

        def unfinished(event: object) -> None:
            if isinstance(event, JournalEntry) and event.state == ASKED:
                raise RequestError("a change is unfinished on this bus")

        there.bus.report = unfinished
        with pytest.raises(RequestError, match="is unfinished"):
            write(there.device)
        assert there.sent() == []
