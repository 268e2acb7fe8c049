"""All projects taken out and put back: equal in all that has a name, and told where they cannot be."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorbus.core.operation import Progress, outcome
from motorbus.errors import MotorbusError, NoReply, RequestError, VerificationFailed
from motorbus.families.stepper.driver.copying import restore
from motorbus.families.stepper.driver.writing import Proof
from motorbus.families.stepper.program.backups import Backup
from motorbus.families.stepper.table import Project
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.written import KINDS, LONGER, PICK, cut_at, named, stored
from tests.support.stepper_projects import projects

kinds = pytest.mark.parametrize("kind", KINDS, ids=named)
ALIKE = replace(LONGER, stop_mode=1)
"""With the same stop mode as PICK: a controller may have only one."""


def filled(there: Bench) -> Backup:
    """Two projects that are there, and two that are not."""
    device = there.device
    for project in (PICK, replace(ALIKE, number=3)):
        device.write_project(_program(project))
    device.clear(1, expert=True)
    return device.backup()


def _program(project: Project) -> Any:
    from motorbus.families.stepper import Program

    return Program(project=project)


def spoiled(there: Bench) -> None:
    """Everything is something else."""
    for number in (1, 2, 4):
        there.device.write_project(_program(replace(ALIKE, number=number).with_step(2, speed=99)))
    there.device.clear(3)


def test_a_backup_reads_each_twice_and_writes_nothing() -> None:
    with bench() as there:
        found = there.device.backup()
        assert [frame[:11] for frame in there.sent()] == [f"FF AA 3E 0{n}" for n in (1, 1, 2, 2, 3, 3, 4, 4)]
        assert found.projects == (1, 2, 3, 4)
        assert found.dumps[1] == there.device.dump(1)
        assert [one.done for one in there.events if isinstance(one, Progress)] == [0, 1, 2, 3, 4]


def test_some_may_be_enough() -> None:
    with bench() as there:
        assert there.device.backup((3, 1, 3)).projects == (1, 3)
        wrong: list[Any] = [(0,), (5,), ("1",), (True,)]
        for bad in wrong:
            with pytest.raises(RequestError, match="there is no project"):
                there.device.backup(bad)


@kinds
def test_what_was_taken_out_is_put_back(kind: dict[str, Any]) -> None:
    with bench(**kind) as there:
        kept = filled(there)
        slots = dict(there.simulated.store.stored)
        spoiled(there)
        told = there.device.restore(Backup.parse(kept.text()))
        assert [one.project for one in told] == [1, 2, 3, 4]
        assert {one.proof for one in told} == {
            Proof.CLEARED,
            Proof.STORED if kind["read_view"] == "stored" else Proof.ACKNOWLEDGED,
        }
        there.simulated.power_cycle()
        assert there.device.backup() == kept
        assert there.simulated.store.stored == slots


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first=projects(), second=projects(), order=st.sampled_from(("little", "big")))
def test_any_projects_come_back_with_the_rows_behind_the_last_step(
    first: Project, second: Project, order: str
) -> None:
    with bench(dump_order=order) as there:
        there.simulated.put(1, first)
        there.simulated.put(3, second)
        kept = there.device.backup()
        there.simulated.put(1, second)
        there.simulated.put(3, first)
        there.device.restore(kept)
        assert stored(there.simulated, 1) == replace(first, number=1)
        assert stored(there.simulated, 3) == replace(second, number=3)


def test_what_is_as_it_was_is_not_written() -> None:
    with bench() as there:
        kept = filled(there)
        there.sent()
        told = there.device.restore(kept)
        assert {one.proof for one in told} == {Proof.UNCHANGED}
        assert all(frame.startswith("FF AA 3E") for frame in there.sent())


def test_some_may_be_put_back() -> None:
    with bench() as there:
        kept = filled(there)
        spoiled(there)
        assert [one.project for one in there.device.restore(kept, (2,))] == [2]
        assert stored(there.simulated, 2) == PICK
        assert stored(there.simulated, 4) != Project()


def test_another_order_of_bytes_makes_no_difference() -> None:
    with bench() as there:
        kept = filled(there)
    with bench(dump_order="big") as there:
        there.device.restore(kept)
        assert stored(there.simulated, 2) == PICK


def test_bytes_that_cannot_be_written_are_told() -> None:
    with bench() as there:
        image = bytearray(filled(there).image(2))
        image[18] = 0x5A
        there.simulated.store.stored[2] = bytes(image)
        kept = there.device.backup()
        spoiled(there)
        there.simulated.store.stored[2] = bytes(220)
        two = there.device.restore(kept)[1]
        assert two.reserved == {18: 0}


def test_a_controller_with_one_stop_mode_for_all_is_told() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        there.simulated.put(3, LONGER)
        kept = there.device.backup((2, 3))
    with bench(flags_scope="device") as there:
        with pytest.raises(VerificationFailed, match="has changed with the others") as told:
            there.device.restore(kept)
        assert "these were restored: 2, 3" in told.value.__notes__[-1]


def _dumps(project: Project) -> Backup:
    return Backup(dumps={2: _program(project).dump()})


BAD = {
    "eleven steps": _dumps(replace(PICK, total_steps=11)),
    "no microsteps": _dumps(replace(PICK, microsteps=0)),
    "output 9": _dumps(PICK.with_step(3, output=9)),
    "mode 4": _dumps(replace(PICK, mode4=7)),
    "input 6": _dumps(PICK.with_step(1, start_input=6)),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
def test_what_no_project_can_hold_is_not_put_back(bad: Backup) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="project 2 of this backup cannot be written"):
            there.device.restore(bad)
        assert there.sent() == []


@pytest.mark.parametrize("numbers", [(3,), (0,), (5,), ("2",)])
def test_what_is_not_in_it_is_not_put_back(numbers: Any) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="there is no project"):
            there.device.restore(_dumps(PICK), numbers)
        assert there.sent() == []


def test_an_error_says_which_are_restored() -> None:
    with bench() as there:
        kept = filled(there)
        spoiled(there)
        act = restore(there.device, kept)
        seen = []

        def watch(event: object) -> None:
            seen.append(event)
            if len(seen) == 4:
                there.simulated.unplug()

        there.bus.report = watch
        with pytest.raises(MotorbusError) as told:
            there.run(act)
        assert told.value.__notes__[-1] == "of the projects 1, 2, 3, 4 these were restored: 1"


@pytest.mark.parametrize("moment", [0.2, 0.6, 0.9, 1.2, 1.8, 2.4, 3.0, 3.6])
def test_a_power_cut_is_mended_by_restoring_again(moment: float) -> None:
    with bench(pace=True) as there:
        kept = filled(there)
        spoiled(there)
        cut_at(there, moment)
        there.run(outcome(restore(there.device, kept)))
        there.device.restore(kept)
        there.simulated.power_cycle()
        assert there.device.backup() == kept


def test_a_controller_that_is_gone_is_an_error() -> None:
    with bench() as there:
        there.simulated.unplug()
        with pytest.raises(NoReply):
            there.device.backup()
