"""What is being edited is brought to be as it is meant, on every kind of controller, and nothing is saved by that."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorbus.core.operation import Progress, outcome
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.stepper.driver.editing import Readback, brought, changes, edits_to
from motorbus.families.stepper.table import (
    EMPTY,
    Project,
    decode_image,
    encode_image,
    refusals,
)
from tests.families.stepper.bench import Bench, Tampering, bench
from tests.families.stepper.written import KINDS, LONGER, PICK, cut_at, named, program, stored
from tests.protocol.stepper.program.projects import projects

SELECT = "FF AA 6E"
kinds = pytest.mark.parametrize("kind", KINDS, ids=named)


def image(there: Bench, number: int) -> bytes:
    return there.device.dump(number)[6:]


def bring(there: Bench, after: Project, **options: Any) -> Readback:
    before = image(there, after.number)
    there.sent()
    return there.run(brought(there.device, before, after, **options))


def edited(there: Bench) -> Project:
    """What the controller itself is editing, with the flags that are in force."""
    return there.simulated.store.project(there.simulated.store.selected)


def test_one_field_takes_the_selection_and_one_command_and_one_dump() -> None:
    with bench() as there:
        after = decode_image(image(there, 1)).with_step(1, delay=500)
        found = bring(there, after)
        assert there.sent() == [
            "FF AA 6E 01 01 00 00 00 00 00 19",
            "FF AA 03 07 F4 01 00 00 00 01 A9",
            "FF AA 3E 01 00 00 00 00 00 00 E8",
        ]
        assert (found.view, found.commands, found.dumps) == ("working", 2, 1)
        assert decode_image(found.image) == after == edited(there)


def test_nothing_that_differs_is_nothing_sent() -> None:
    with bench() as there:
        after = decode_image(image(there, 1))
        assert bring(there, after) == Readback(image(there, 1), "untold", 0, 0)
        assert [frame[:8] for frame in there.sent()] == ["FF AA 3E"] * 2


def test_every_field_is_sent_when_it_is_wanted() -> None:
    with bench() as there:
        found = bring(there, decode_image(image(there, 1)), every=True)
        assert (found.view, found.commands, found.dumps) == ("untold", 78, 1)


def test_a_cleared_project_is_written_in_full() -> None:
    with bench() as there:
        found = bring(there, replace(PICK, number=3))
        assert (found.view, found.commands, found.dumps) == ("working", 8 + 7 * 3, 1)


@kinds
def test_it_is_as_meant_on_every_kind_of_controller_and_not_saved(kind: dict[str, Any]) -> None:
    with bench(**kind) as there:
        there.simulated.put(2, PICK)
        slots = dict(there.simulated.store.stored)
        for meant in (LONGER, replace(LONGER, number=4), PICK.with_step(3, delay=1), replace(PICK, number=1)):
            found = bring(there, meant)
            assert edited(there) == meant
            assert found.view == kind["read_view"]
            assert there.simulated.store.stored == slots


@kinds
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(one=projects(), other=projects())
def test_any_project_becomes_any_other(kind: dict[str, Any], one: Project, other: Project) -> None:
    meant = replace(other, number=one.number)
    with bench(**kind) as there:
        there.simulated.put(one.number, one)
        bring(there, meant)
        assert edited(there) == meant


def test_what_another_project_left_under_this_name_is_written_over() -> None:
    with bench(select="relabel") as there:
        there.simulated.put(1, LONGER)
        there.simulated.put(2, PICK)
        found = bring(there, PICK.with_step(1, delay=1))
        assert (found.view, found.commands, found.dumps) == ("working", 2 + 78, 4)
        assert edited(there) == PICK.with_step(1, delay=1)


def test_a_controller_that_shows_what_is_stored_is_found_out_once() -> None:
    with bench(read_view="stored") as there:
        there.simulated.put(2, PICK)
        found = bring(there, PICK.with_step(1, delay=1))
        assert (found.view, found.commands, found.dumps) == ("stored", 2 + 78, 2)
        found = bring(there, PICK.with_step(1, delay=2))
        assert (found.view, found.commands, found.dumps) == ("stored", 78, 1)
        assert edited(there) == PICK.with_step(1, delay=2)


class Numberless(Tampering):
    """Dumps do not repeat the number of the project, which is an assumption."""

    def change(self, data: bytes, number: int) -> bytes:
        return data[:6] + b"\0" + data[7:] if len(data) == 226 else data


def test_a_dump_without_its_number_will_do() -> None:
    with bench(line=Numberless()) as there:
        there.simulated.put(2, PICK)
        assert there.device.write_project(program(PICK, delay=1)).commands == 3
        assert stored(there.simulated, 2) == PICK.with_step(1, delay=1)


def test_rows_behind_the_last_step_are_brought_too() -> None:
    with bench() as there:
        after = decode_image(image(there, 1)).with_step(9, distance=5)
        found = bring(there, after)
        assert (found.commands, edited(there).step(9).distance) == (2, 5)


def test_a_number_that_no_command_carries_is_left_as_it_is() -> None:
    odd = replace(PICK, microsteps=0, loop_first=3, loop_last=2)
    with bench(select="relabel", shipped="empty") as there:
        there.simulated.put(2, odd)
        with pytest.raises(
            VerificationFailed
        ):  # it is another project's working copy, and 0 cannot be written
            bring(there, replace(PICK, number=2, microsteps=0, turn_distance=1))
    with bench() as there:
        there.simulated.put(2, odd)
        assert bring(there, odd.with_step(1, delay=9)).view == "working"
        assert edited(there) == odd.with_step(1, delay=9)


BAD = {
    "no steps": replace(PICK, total_steps=0),
    "eleven steps": replace(PICK, total_steps=11),
    "project 0": replace(PICK, number=0),
    "project 5": replace(PICK, number=5),
    "no microsteps": replace(PICK, microsteps=0),
    "a large angle": replace(PICK, step_angle=256),
    "no turn": replace(PICK, turn_distance=0),
    "a long delay": PICK.with_step(2, delay=1 << 24),
    "a negative distance": PICK.with_step(1, distance=-1),
    "input 6": PICK.with_step(3, stop_input=6),
    "output 9": PICK.with_step(3, output=9),
    "a loop that ends before it begins": replace(PICK, loop_first=3, loop_last=2, loop_count=2),
    "a variant of mode 4": replace(PICK, mode4=3),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
def test_what_cannot_be_sent_is_refused_before_anything_is(bad: Project) -> None:
    with bench() as there:
        there.simulated.put(2, LONGER)
        before = image(there, 2)
        there.sent()
        with pytest.raises(RequestError):
            there.run(brought(there.device, before, bad))
        assert there.sent() == []


def test_inputs_3_and_4_can_be_given_back_to_who_had_them() -> None:
    with bench() as there:
        meant = PICK.with_step(1, start_input=3)
        assert [*refusals(meant)]
        bring(there, meant)
        assert edited(there) == meant


def test_an_image_of_another_length_is_none() -> None:
    with bench() as there:
        before = there.device.dump(1)
        with pytest.raises(RequestError, match="226 bytes"):
            there.run(brought(there.device, before, PICK))


def test_progress_is_reported() -> None:
    with bench() as there:
        bring(there, replace(PICK, number=3))
        told = [event for event in there.events if isinstance(event, Progress)]
        assert [one.done for one in told] == list(range(30))
        assert {one.total for one in told} == {29}


class Deaf(Tampering):
    """From the so-many-th reply on, nothing comes."""

    def __init__(self, last: int) -> None:
        super().__init__()
        self.last = last

    def change(self, data: bytes, number: int) -> bytes:
        return data if number <= self.last else b""


@pytest.mark.parametrize("acknowledged", [0, 1, 7])
def test_an_error_from_the_middle_says_what_may_be_half_written(acknowledged: int) -> None:
    with bench(line=Deaf(2 + acknowledged)) as there:
        slots = dict(there.simulated.store.stored)
        with pytest.raises(OutcomeUnknown) as told:
            bring(there, replace(PICK, number=3))
        (note,) = told.value.__notes__
        assert note.startswith(
            f"{acknowledged} of 29 commands were acknowledged; what is edited of project 3 may be"
        )
        assert "it was not saved" in note
        assert there.simulated.store.stored == slots


def test_so_does_one_from_the_reading_behind() -> None:
    with bench(line=Deaf(2 + 2 + 2)) as there, pytest.raises(NoReply) as told:
        bring(there, decode_image(image(there, 1)).with_step(1, delay=1))
    assert "may be half written; it was not saved" in told.value.__notes__[0]


class Freezing(Tampering):
    """A byte of each dump that is behind the first two comes as another one, the same each time."""

    def change(self, data: bytes, number: int) -> bytes:
        return data[:40] + b"\7" + data[41:] if len(data) == 226 and number > 2 else data


def test_what_does_not_read_as_meant_after_all_is_told_with_both_values() -> None:
    with bench(line=Freezing()) as there, pytest.raises(VerificationFailed) as told:
        bring(there, decode_image(image(there, 1)).with_step(1, delay=500))
    assert "step_1_start_input: none -> 7" in str(told.value)
    assert "it was not saved" in told.value.advice


def test_the_wrong_order_of_bytes_is_named() -> None:
    with bench(dump_order="big", shipped="empty") as there:
        device = type(there.device)(there.bus)
        object.__setattr__(device, "order", "little")
        with pytest.raises(VerificationFailed) as told:
            there.run(brought(device, bytes(220), PICK))
    assert told.value.advice == "open the bus with dump_order=big"


@pytest.mark.parametrize("moment", [0.01, 0.1, 0.3, 0.45, 0.6])
def test_a_power_cut_in_the_middle_is_mended_or_told(moment: float) -> None:
    with bench(pace=True) as there:
        there.simulated.put(2, PICK)
        before, meant = image(there, 2), LONGER.with_step(1, delay=1)
        cut_at(there, moment)
        told = there.run(outcome(brought(there.device, before, meant)))
        assert isinstance(told, MotorbusError) or decode_image(told.image) == meant
        assert stored(there.simulated, 2) == PICK


def test_edits_are_those_that_are_needed() -> None:
    assert edits_to(PICK, PICK) == []
    assert [one.command for one in edits_to(PICK, PICK.with_step(3, speed=9))] == [
        "select_project",
        "set_step_accel_speed",
    ]
    assert len(edits_to(Project(), PICK)) == 8 + 7 * 3
    beyond = PICK.with_step(7, delay=1)
    assert len(edits_to(Project(), beyond)) == 8 + 7 * 7


def test_changes_have_both_values_in_the_unit_of_the_api() -> None:
    (speed, way) = changes(PICK, PICK.with_step(1, speed=120, direction=1))
    assert (way.name, way.step) == ("step_1_speed", 1)
    assert (way.before, way.after) == pytest.approx((6.2832, 12.5664), abs=1e-4)
    assert str(way) == "step_1_speed: 6.28319 rad/s -> 12.5664 rad/s"
    assert str(speed) == "step_1_direction: forward -> reverse"
    assert [*changes(PICK, replace(PICK, number=4))] == []


def test_images_and_numbers_agree() -> None:
    assert decode_image(encode_image(PICK)) == PICK
    assert PICK.step(4) == EMPTY


def test_a_selection_that_nobody_answers_is_not_known() -> None:
    with bench(line=Deaf(2 + 2)) as there, pytest.raises(OutcomeUnknown, match="did not answer"):
        bring(there, decode_image(image(there, 1)).with_step(1, delay=1))


@st.composite
def faults(draw: st.DrawFn) -> dict[str, Any]:
    return {
        "reply_fault": draw(
            st.sampled_from(("lost", "unheard", "late", "doubled", "bit", "other", "split", "noise"))
        ),
        "dump_fault": draw(st.sampled_from(("none", "short", "byte"))),
        "fault_every": draw(st.integers(2, 9)),
        "fault_time": draw(st.sampled_from((0.03, 0.2, 0.5))),
        "seed": draw(st.integers(0, 1000)),
    }


@settings(max_examples=60, deadline=None)
@given(how=faults(), kind=st.sampled_from(KINDS))
def test_faults_are_overcome_or_told_and_never_believed(how: dict[str, Any], kind: dict[str, Any]) -> None:
    with bench(**kind) as there:
        there.simulated.put(2, PICK)
        slots, before = dict(there.simulated.store.stored), image(there, 2)
        there.simulated.switch(**how)
        try:
            there.run(brought(there.device, before, LONGER))
        except MotorbusError:
            pass
        else:
            assert edited(there) == LONGER
        assert there.simulated.store.stored == slots
