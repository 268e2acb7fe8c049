"""What was edited and not saved, by this host or by somebody else: in force, and perhaps not to be read.

A controller may show what is stored while something else is being edited, and it may lose its supply and edit project 1
again. Neither may let a save store the wrong project, or a write call something unchanged that is not.
"""

from __future__ import annotations

import pytest

from motorbus.core.steps import INTENT, JournalEntry
from motorbus.errors import OutcomeUnknown, RequestError
from motorbus.families.stepper.driver.writing import Proof
from tests.families.stepper.bench import Tampering, bench
from tests.families.stepper.loans import Line1
from tests.families.stepper.test_driver_selecting import Losing
from tests.families.stepper.written import PICK, program, stored

EDITED = PICK.with_step(1, delay=1000)
ALL = 78


# -- saving ------------------------------------------------------------------------------------------------------------


def test_saving_never_stores_the_project_that_the_controller_edits_since_its_supply_was_gone() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        before = dict(there.simulated.store.stored)
        there.device.write_project(program(EDITED), save=False)
        there.device.write_project(
            program(PICK), save=False
        )  # as it is stored: it reads so after a power cycle too
        there.simulated.power_cycle()
        assert there.simulated.store.selected == 1
        assert there.device.save(2).saved
        assert there.simulated.store.stored == before


def test_a_save_selects_its_project_before() -> None:
    with bench() as there:
        there.device.write_project(program(PICK), save=False)
        there.sent()
        there.device.save(2)
        codes = [frame[6:8] for frame in there.sent()]
        assert codes[:3] == ["3E", "3E", "6E"]
        assert codes[-3:] == ["3E", "2E", "3E"]


def test_a_save_that_failed_can_be_said_again() -> None:
    line = Losing("FF AA 6E", 0)
    with bench(line=line) as there:
        there.device.write_project(program(PICK), save=False)
        line.times = 9
        with pytest.raises(OutcomeUnknown):
            there.device.save(2)
        line.times = 0
        assert there.device.save(2).saved
        assert stored(there.simulated, 2) == PICK


# -- writing -----------------------------------------------------------------------------------------------------------


def test_edits_that_cannot_be_read_are_undone_by_writing_what_is_stored() -> None:
    with bench(read_view="stored") as there:
        there.simulated.put(2, PICK)
        there.device.write_project(program(EDITED), save=False)
        told = there.device.write_project(program(PICK), save=False)
        assert (told.proof, told.commands) == (Proof.NOT_SEEN, ALL)
        assert [str(one) for one in told.changes] == ["step_1_delay: 1 s -> 0.5 s"]
        assert there.simulated.store.project(2) == PICK, "this is what a run takes"


@pytest.mark.parametrize("save", [True, False])
def test_their_cost_is_told_before(save: bool) -> None:
    with bench(read_view="stored") as there:
        there.simulated.put(2, PICK)
        there.device.write_project(program(EDITED), save=False)
        plan = there.device.difference(program(PICK), save=save)
        told = there.device.write_project(program(PICK), save=save)
        assert plan
        assert (plan.before, plan.after) == (EDITED, PICK)
        assert (plan.cost.writes, plan.cost.reads) == (told.commands, told.dumps) == (ALL + save, 3 + save)


def test_where_edits_can_be_read_the_reading_is_believed() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        there.device.write_project(program(EDITED), save=False)
        there.simulated.power_cycle()
        assert there.device.write_project(program(PICK), save=False).proof is Proof.UNCHANGED


# -- what differed beyond the plan ----------------------------------------------------------------------------------


def test_edits_of_somebody_else_that_were_kept_with_it_are_told() -> None:
    with bench() as there:
        there.press("FF AA 03 05 1F 00 64 00 00 01 35")  # acceleration 31 instead of 30, not saved
        told = there.device.write(step_1_delay=0.5)
        assert [one.name for one in told.changes] == ["step_1_delay"]
        assert [one.name for one in told.more] == ["step_1_acceleration"]
        assert "1 changed and 1 more that the read-back showed to differ" in str(told)


def test_what_was_planned_and_took_two_rounds_is_told_once() -> None:
    class Forgetful(Tampering):
        def change(self, data: bytes, number: int) -> bytes:
            if number == 4:  # that to the second edit: it is acknowledged, and something else by then
                there.simulated.store.edit("set_step_delay", {"step": 1, "delay": 77})
            return data

    with bench(line=Forgetful()) as there:
        told = there.device.write(step_1_delay=0.5)
        assert (told.commands, told.more) == (2 + ALL + 1, ())
        assert [one.name for one in told.changes] == ["step_1_delay"]
        assert stored(there.simulated, 1).step(1).delay == 500


@pytest.mark.parametrize("view", ["working", "stored"])
def test_nothing_more_is_told_where_there_is_nothing(view: str) -> None:
    with bench(read_view=view) as there:
        told = there.device.write(step_1_delay=0.5)
        assert (told.more, told.shared) == ((), ())
        assert "1 changed, " in str(told)


def test_a_flag_that_may_be_that_of_the_device_is_told_to_be_so() -> None:
    with bench(flags_scope="device") as there:
        there.simulated.put(2, PICK)
        there.device.write(project=2, stop_mode=0)
        before = there.device.dump(3)
        told = there.device.write(project=2, stop_mode=1)
        assert there.device.dump(3) != before
        assert told.shared == ("stop_mode",)
        assert "1 changed (stop_mode: perhaps for all projects)" in str(told)


# -- while it is lent ------------------------------------------------------------------------------------------------


def test_what_is_lent_to_a_motion_that_was_cut_off_is_not_kept_as_a_backup() -> None:
    line = Line1()
    line.journal(JournalEntry("jog", INTENT, {"node": 1, "image": line.before.hex(), "order": "little"}))
    told = line.run(lambda device: device.backup())
    assert isinstance(told, RequestError)
    assert line.sent == []
