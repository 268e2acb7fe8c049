"""A program put into a controller: minimal, read back, saved, read back again, and no more claimed than that."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorbus.core.steps import JournalEntry, Progress, catch
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper import AsyncController, Controller, Program
from motorbus.families.stepper.driver.writing import Planned, Proof, Written, write_project
from motorbus.families.stepper.table import Project
from tests.families.stepper.bench import Tampering, bench
from tests.families.stepper.written import (
    KINDS,
    LONGER,
    PICK,
    named,
    program,
    stored,
)
from tests.protocol.stepper.projects import projects

kinds = pytest.mark.parametrize("kind", KINDS, ids=named)
READ_2 = "FF AA 3E 02 00 00 00 00 00 00 E9"
SAVE_2 = "FF AA 2E 02 00 00 00 00 00 00 D9"


def test_one_field_is_three_commands_and_four_dumps() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        told = there.device.write_project(program(PICK, delay=1000))
        assert there.sent() == [
            READ_2,
            READ_2,
            "FF AA 6E 02 03 00 00 00 00 00 1C",
            "FF AA 03 07 E8 03 00 00 00 01 9F",
            READ_2,
            SAVE_2,
            READ_2,
        ]
        assert (told.commands, told.dumps, told.saved) == (3, 4, True)
        assert told.proof is Proof.ACKNOWLEDGED
        assert [str(one) for one in told.changes] == ["step_1_delay: 0.5 s -> 1 s"]
        assert stored(there.simulated, 2) == PICK.with_step(1, delay=1000)


def test_what_is_there_already_is_not_written() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        told = there.device.write_project(program(PICK))
        assert there.sent() == [READ_2] * 2
        assert (told.commands, told.saved, told.proof) == (0, False, Proof.UNCHANGED)
        assert not there.device.difference(program(PICK))


@kinds
def test_every_kind_of_controller_has_it_stored_and_the_other_projects_as_before(
    kind: dict[str, Any],
) -> None:
    with bench(**kind) as there:
        there.simulated.put(2, LONGER)
        others = {number: there.simulated.store.stored[number] for number in (1, 3, 4)}
        for meant in (PICK, PICK.with_step(1, delay=1), LONGER.with_step(4, speed=31)):
            told = there.device.write_project(program(meant))
            assert told.saved
            assert told.proof is (Proof.STORED if kind["read_view"] == "stored" else Proof.ACKNOWLEDGED)
            assert stored(there.simulated, 2).steps[: meant.total_steps] == meant.steps[: meant.total_steps]
            assert replace(stored(there.simulated, 2), steps=()) == replace(meant, steps=())
        assert {number: there.simulated.store.stored[number] for number in (1, 3, 4)} == others


@kinds
@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(one=projects(), other=projects(), first=st.integers(1, 4))
def test_any_program_is_stored_over_any_other(
    kind: dict[str, Any], one: Project, other: Project, first: int
) -> None:
    with bench(selected_at_boot=first, **kind) as there:
        there.simulated.put(other.number, one)
        there.device.write_project(program(other), expert=True)
        rows = other.steps[: other.total_steps] + one.steps[other.total_steps :]
        assert stored(there.simulated, other.number) == replace(other, steps=rows)


def test_rows_behind_the_last_step_stay_as_they_are() -> None:
    with bench() as there:
        there.simulated.put(2, LONGER)
        there.device.write_project(program(PICK))
        assert stored(there.simulated, 2).step(4) == LONGER.step(4)


def test_what_is_not_saved_goes_with_the_supply_and_the_proof_says_so() -> None:
    for view, proof in (("working", Proof.NOT_SAVED), ("stored", Proof.NOT_SEEN)):
        with bench(read_view=view) as there:
            told = there.device.write_project(program(PICK), save=False)
            assert (told.saved, told.proof) == (False, proof)
            assert there.simulated.store.project(2) == PICK
            assert stored(there.simulated, 2) == Project()


@pytest.mark.parametrize("view", ["working", "stored"])
def test_what_was_not_saved_is_saved_by_writing_it_again(view: str) -> None:
    with bench(read_view=view) as there:
        there.device.write_project(program(PICK), save=False)
        there.sent()
        told = there.device.write_project(program(PICK))
        assert told.saved
        assert there.sent()[-2:] == [SAVE_2, READ_2]
        assert stored(there.simulated, 2) == PICK


def test_edits_of_another_host_that_the_selection_loses_are_written_again() -> None:
    with bench() as there:
        there.press("FF AA 03 05 1F 00 64 00 00 01 35")  # acceleration 31 instead of 30, not saved
        there.sent()
        assert there.device.write(step_1_delay=0.5).commands == 2 + 78 + 1
        assert stored(there.simulated, 1).step(1).acceleration == 31
        assert stored(there.simulated, 1).step(1).delay == 500


def test_what_went_with_the_supply_is_not_saved_under_another_name() -> None:
    with bench() as there:
        there.device.write_project(program(PICK))
        there.device.write_project(program(PICK, delay=1), save=False)
        there.simulated.power_cycle()
        told = there.device.write_project(program(PICK))
        assert (told.commands, told.proof) == (0, Proof.UNCHANGED)
        assert stored(there.simulated, 2) == PICK


def test_the_plan_comes_before_the_first_command() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        there.device.write_project(program(PICK, delay=1000))
        plan, *rest = [one for one in there.events if not isinstance(one, JournalEntry)]
        assert isinstance(plan, Planned)
        assert str(plan.difference).startswith("project 2: 3 commands and 4 dumps, about ")
        assert [edit.command for edit in plan.difference.edits] == ["select_project", "set_step_delay"]
        assert all(isinstance(event, Progress) for event in rest)


def test_a_host_that_does_not_like_the_plan_has_sent_nothing() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)

        def refuse(event: object) -> None:
            if isinstance(event, Planned):
                raise KeyboardInterrupt

        there.bus.report = refuse
        with pytest.raises(KeyboardInterrupt):
            there.device.write_project(program(LONGER))
        assert there.sent() == [READ_2] * 2


def test_reserved_bytes_are_told_and_left_alone() -> None:
    with bench() as there:
        there.simulated.put(2, PICK)
        image = bytearray(there.simulated.store.stored[2])
        image[17], image[39] = 0xAA, 0x55
        there.simulated.store.stored[2] = bytes(image)
        assert there.device.write_project(program(PICK, delay=1)).reserved == {17: 0xAA, 39: 0x55}
        assert there.simulated.store.stored[2][39] == 0x55
        same = Program.from_dump(there.device.dump(2))
        assert there.device.difference(same).reserved == {}


BAD: dict[str, tuple[Program, dict[str, Any]]] = {
    "no project": (program(replace(PICK, number=0)), {}),
    "project 5": (program(PICK), {"project": 5}),
    "project as text": (program(PICK), {"project": "2"}),
    "project True": (program(PICK), {"project": True}),
    "no steps": (program(Project(number=2)), {}),
    "eleven steps": (program(replace(PICK, total_steps=11)), {}),
    "three rows": (program(replace(PICK, steps=PICK.steps[:3])), {}),
    "no geometry": (program(replace(PICK, microsteps=0)), {}),
    "a long delay": (program(PICK, delay=1 << 24), {"expert": True}),
    "a speed that is none": (program(PICK, speed=70000), {"expert": True}),
    "input 4": (program(PICK, stop_input=4), {}),
    "input 6 for an expert": (program(PICK, stop_input=6), {"expert": True}),
    "no ramp": (program(PICK, start_frequency=60000), {}),
    "a loop that ends before it begins": (
        program(replace(PICK, loop_first=3, loop_last=2, loop_count=2)), {"expert": True},
    ),
}  # fmt: skip


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
def test_what_is_bad_changes_nothing(bad: tuple[Program, dict[str, Any]]) -> None:
    what, options = bad
    with bench() as there:
        slots = dict(there.simulated.store.stored)
        with pytest.raises(RequestError) as told:
            there.device.write_project(what, **options)
        assert [frame for frame in there.sent() if not frame.startswith("FF AA 3E")] == []
        assert "nothing was" in str(told.value)
        assert there.simulated.store.stored == slots


def test_an_expert_writes_what_lint_refuses() -> None:
    bad = program(PICK, start_frequency=60000, stop_input=4)
    with bench() as there:
        with pytest.raises(RequestError, match=r"L5 error|L12 error"):
            there.device.write_project(bad)
        assert there.device.write_project(bad, expert=True).saved
        assert stored(there.simulated, 2) == bad.project


# -- by name ----------------------------------------------------------------------------------------------------------


def test_parameters_are_written_by_name_in_api_units() -> None:
    with bench() as there:
        told = there.device.write(step_1_delay=0.5, step_1_speed=6.2832, turn_distance=1600)
        assert {one.name for one in told.changes} == {"step_1_delay", "step_1_speed", "turn_distance"}
        held = stored(there.simulated, 1)
        assert (held.step(1).delay, held.step(1).speed, held.turn_distance) == (500, 60, 1600)


def test_a_parameter_may_stay_unsaved() -> None:
    with bench() as there:
        before = stored(there.simulated, 1)
        assert there.device.write(project=1, save=False, step_1_delay=0.5).proof is Proof.NOT_SAVED
        assert stored(there.simulated, 1) == before


@pytest.mark.parametrize(
    "values",
    [
        {"no_such_row": 1},
        {"step_11_delay": 1.0},
        {"number": 2},
        {"mode4": 1},
        {"power_on_home": 1},
        {"step_1_delay": 20000.0},
        {"step_1_delay": float("nan")},
        {"step_1_direction": 2},
        {"microsteps": 0},
        {"microsteps": 1.5},
        {"loop_first": 3, "loop_last": 2},
        {"step_1_start_input": 6},
    ],
    ids=str,
)
def test_a_parameter_that_is_bad_changes_nothing(values: dict[str, Any]) -> None:
    with bench() as there:
        slots = dict(there.simulated.store.stored)
        with pytest.raises(RequestError):
            there.device.write(step_1_distance=7, **values)
        assert [frame for frame in there.sent() if not frame.startswith("FF AA 3E")] == []
        assert there.simulated.store.stored == slots


def test_a_cleared_project_needs_its_steps() -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="needs steps"):
            there.device.write(project=3, microsteps=8)
        with pytest.raises(RequestError, match="no project 5"):
            there.device.write(project=5, microsteps=8)
        with pytest.raises(RequestError):  # the rest of it is 0 still, which cannot be sent
            there.device.write(project=3, total_steps=1, step_1_delay=1.0)
        assert stored(there.simulated, 3) == Project()


# -- faults ----------------------------------------------------------------------------------------------------------


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


def test_a_save_whose_acknowledgement_is_lost_is_written_whole_and_saved_once_more() -> None:
    with bench(line=Losing("FF AA 2E", 1)) as there:
        there.simulated.put(2, PICK)
        told = there.device.write_project(program(PICK, delay=1))
        assert (told.saved, told.proof, told.commands) == (True, Proof.ACKNOWLEDGED, 3 + 78 + 1)
        assert there.sent().count(SAVE_2) == 2
        assert stored(there.simulated, 2).step(1).delay == 1


def test_where_what_is_stored_is_read_nothing_is_saved_twice() -> None:
    with bench(line=Losing("FF AA 2E", 1), read_view="stored") as there:
        told = there.device.write_project(program(PICK))
        assert (told.saved, told.proof) == (True, Proof.STORED)
        assert there.sent().count(SAVE_2) == 1


def test_a_save_that_never_is_acknowledged_is_not_known() -> None:
    with bench(line=Losing("FF AA 2E", 9)) as there:
        with pytest.raises(OutcomeUnknown) as told:
            there.device.write_project(program(PICK))
        assert "it may hold the old values or the new ones" in "".join(told.value.__notes__)
        assert there.sent().count(SAVE_2) == 2


def test_a_save_that_changed_something_else_is_told() -> None:
    class Storing(Tampering):
        def change(self, data: bytes, number: int) -> bytes:
            if data.startswith(bytes.fromhex("FF AA 2E")):
                there.simulated.put(2, LONGER)
            return data

    with bench(line=Storing()) as there:
        with pytest.raises(VerificationFailed, match="was saved and does not read") as told:
            there.device.write_project(program(PICK))
        assert "total_steps: 3 -> 4" in told.value.expected
        assert "write the project again" in told.value.advice


def test_a_controller_that_is_gone_is_an_error() -> None:
    with bench() as there:
        there.simulated.unplug()
        with pytest.raises(NoReply):
            there.device.write_project(program(PICK))


FAULTS = ("lost", "unheard", "late", "doubled", "bit", "other", "split", "noise")


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("dumps", ["none", "short", "byte"])
@pytest.mark.parametrize("every", [1, 3])
def test_no_fault_makes_a_success_of_something_else(fault: str, dumps: str, every: int) -> None:
    for kind in (KINDS[0], KINDS[-1]):
        with bench(**kind) as there:
            there.simulated.put(2, LONGER)
            others = [there.simulated.store.stored[number] for number in (1, 3, 4)]
            there.simulated.switch(reply_fault=fault, dump_fault=dumps, fault_every=every)
            told = there.run(catch(write_project(there.device, program(PICK))))
            there.simulated.switch(reply_fault="none", dump_fault="none")
            held = stored(there.simulated, 2)
            done = replace(PICK, steps=PICK.steps[:3] + LONGER.steps[3:])
            assert held == done or (isinstance(told, MotorbusError) and held == LONGER)
            assert [there.simulated.store.stored[number] for number in (1, 3, 4)] == others
            assert there.device.write_project(program(PICK)).proof is not Proof.NOT_SAVED
            assert stored(there.simulated, 2) == done


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 10**6),
    requests=st.sampled_from((0.0, 0.003, 0.01)),
    replies=st.sampled_from((0.0, 0.001, 0.003)),
)
def test_a_bad_line_never_makes_one_either(
    kind: dict[str, Any], seed: int, requests: float, replies: float
) -> None:
    with bench(**kind) as there:
        there.simulated.put(2, LONGER)
        there.simulated.switch(request_errors=requests, byte_errors=replies, seed=seed)
        told = there.run(catch(write_project(there.device, program(PICK))))
        if isinstance(told, Written):
            held = stored(there.simulated, 2)
            assert held == replace(PICK, steps=PICK.steps[:3] + LONGER.steps[3:])


def test_what_is_known_is_said_in_words() -> None:
    with bench() as there:
        told = there.device.write_project(program(PICK))
        assert str(told).startswith("project 2, ")
        assert str(told).endswith("that it is stored is proved by a power cycle only")
        assert str(there.device.difference(program(PICK))) == "project 2: nothing differs"
        assert there.device.difference(program(PICK, delay=1)).changes[0].row.name == "step_1_delay"


def test_both_faces_have_the_verbs() -> None:
    for name in ("write_project", "write", "difference", "select", "save", "clear", "backup", "restore"):
        assert callable(getattr(Controller, name).function)
        assert getattr(AsyncController, name).function is getattr(Controller, name).function
