"""Projects: read twice, written as far as they differ, read back, saved, read back again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import pytest

from motorbus.core.steps import ASKED, INTENT, JournalEntry, Progress
from motorbus.errors import (
    FramingError,
    MotorbusError,
    OutcomeUnknown,
    RequestError,
    UnexpectedReply,
    VerificationFailed,
)
from motorbus.families.stepper import Backup, Program
from motorbus.families.stepper.parameters import Project, Step, encode_image, with_steps
from tests.families.stepper.bench import Bench, bench, made

PICK = with_steps(
    Project(number=2, microsteps=16, step_angle=90, turn_distance=5000, project_loop=3, stop_mode=1),
    (
        Step(distance=10000, start_frequency=200, acceleration=100, speed=60, output=1, delay=500),
        Step(distance=56814, direction=1, start_frequency=200, acceleration=100, speed=300, start_input=1),
        Step(distance=43775, start_frequency=200, acceleration=100, speed=300, output=8, stop_input=2),
    ),
)
"""Three steps, with EE DD and FF AA among their bytes."""
SHORT = Step(distance=7, speed=30, start_frequency=90, acceleration=9, delay=70)
KINDS: list[dict[str, Any]] = [
    {"select": select, "read_view": view, "dump_order": order}
    for select, view, order in product(("load", "relabel"), ("working", "stored"), ("little", "big"))
]
SAVE_2 = "FF AA 2E 02"


@pytest.fixture
def one() -> Iterator[Bench]:
    with bench(PICK) as found:
        yield found


def stored(one: Bench, number: int) -> Project:
    """What a power cycle leaves in a slot."""
    one.simulated.power_cycle()
    return one.simulated.store.stored[number]


def noisy(dumps: int, at: int = 40) -> Any:
    """A line that changes a byte in each of the next dumps, to another value each time."""
    left = iter(range(dumps))

    def change(data: bytes) -> bytes:
        count = next(left, None) if len(data) == 226 else None
        return data if count is None else data[:at] + bytes([data[at] ^ (count + 1)]) + data[at + 1 :]

    return change


# -- read --------------------------------------------------------------------------------------------------------------


def test_two_equal_dumps_count_as_read(one: Bench) -> None:
    assert one.device.read_project(2).project == PICK
    assert len(one.sent()) == 2
    one.line.change = noisy(1)
    assert one.device.read_project(2).project == PICK
    assert len(one.sent()) == 3
    one.line.change = noisy(5)
    with pytest.raises(FramingError, match="5 times"):
        one.device.dump(2)


def test_parameters_read_in_api_units(one: Bench) -> None:
    values = one.device.read("step_1_delay", "step_2_speed", "microsteps", project=2)
    assert values == {"step_1_delay": 0.5, "step_2_speed": pytest.approx(31.4159, 1e-4), "microsteps": 16}
    assert one.device.read_raw("step_1_delay", project=2) == {"step_1_delay": 500}
    assert len(one.device.read(project=2)) == 102
    one.sent()
    with pytest.raises(RequestError, match="step_11_delay"):
        one.device.read("step_11_delay")
    assert one.sent() == []


def test_dump_of_another_project_is_refused(one: Bench) -> None:
    one.line.change = lambda data: data[:6] + b"\x03" + data[7:] if len(data) == 226 else data
    with pytest.raises(UnexpectedReply, match="project 3"):
        one.device.dump(2)


# -- write -------------------------------------------------------------------------------------------------------------


def test_only_what_differs_is_sent_and_one_dump_verifies_it(one: Bench) -> None:
    written = one.device.write_project(Program(project=PICK.with_step(3, delay=1000)))
    assert written == (2, {"step_3_delay": (0, 1000)}, "saved")
    assert [frame[:11] for frame in one.sent()] == [
        "FF AA 3E 02", "FF AA 3E 02", "FF AA 6E 02", "FF AA 03 07", "FF AA 3E 02", SAVE_2, "FF AA 3E 02",
    ]  # fmt: skip
    assert stored(one, 2) == PICK.with_step(3, delay=1000)


def test_equal_project_is_not_written(one: Bench) -> None:
    assert one.device.write_project(Program(project=PICK)).proof == "unchanged"
    assert {frame[6:8] for frame in one.sent()} == {"3E"}
    assert one.device.difference(Program(project=PICK)) == {}
    assert one.device.difference(Program(project=replace(PICK, stop_mode=0))) == {"stop_mode": (1, 0)}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: "-".join(kind.values()))
@pytest.mark.parametrize("number", [1, 2])
def test_every_kind_of_controller_stores_it(kind: dict[str, Any], number: int) -> None:
    with bench(PICK, **kind) as one:
        other = made(SHORT, number=number, stop_mode=1)
        assert one.device.write_project(Program(project=other)).proof == "saved"
        found = stored(one, number)
        assert found.used == other.used
        assert replace(found, steps=other.steps) == other
        assert stored(one, 3) == Project()


def test_steps_beyond_the_last_are_kept(one: Bench) -> None:
    shorter = with_steps(PICK, PICK.steps[:1])
    one.device.write_project(Program(project=shorter))
    assert stored(one, 2) == replace(PICK, total_steps=1)


def test_write_by_name_checks_everything_first(one: Bench) -> None:
    written = one.device.write(project=2, step_1_delay=0.25, project_loop=7)
    assert written.changes == {"project_loop": (3, 7), "step_1_delay": (500, 250)}
    one.sent()
    for values, match in (
        ({"step_1_delay": 1.0, "speed": 1}, "speed"),
        ({"step_1_delay": 1.0, "microsteps": 0}, "microsteps"),
        ({"mode4": 1}, "mode4"),
        ({"number": 3}, "number"),
    ):
        with pytest.raises(RequestError, match=match):
            one.device.write(project=2, **values)
    assert one.sent() == []
    with pytest.raises(RequestError, match="has no steps"):
        one.device.write(project=3, step_1_delay=1.0)
    assert (
        one.device.write(project=3, total_steps=1, microsteps=8, step_angle=0.03, turn_distance=9).proof
        == "saved"
    )


def test_program_with_errors_needs_an_expert(one: Bench) -> None:
    wrong = Program(project=replace(PICK, loop_first=3, loop_last=2, loop_count=2))
    with pytest.raises(RequestError):
        one.device.write_project(wrong)
    slow = Program(project=PICK.with_step(1, start_frequency=0))
    assert [found.level for found in slow.lint() if found.level == "error"], (
        "this program has an error of lint"
    )
    with pytest.raises(RequestError, match="errors"):
        one.device.write_project(slow)
    assert one.sent() == []
    assert one.device.write_project(slow, expert=True).proof == "saved"


def test_noise_in_a_read_back_is_no_difference(one: Bench) -> None:
    noise = noisy(1)
    one.line.change = lambda data: (
        noise(data)
        if one.line.request[2] == 0x3E and one.simulated.store.working.step(1).delay == 250
        else data
    )
    assert one.device.write(project=2, step_1_delay=0.25).proof == "saved"
    assert sum(frame.startswith("FF AA 03") for frame in one.sent()) == 1, "nothing was written twice"


def test_value_that_the_controller_refuses_is_told(one: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    edit = one.simulated.store.edit
    monkeypatch.setattr(
        one.simulated.store,
        "edit",
        lambda name, values: edit(name, {**values, "delay": 1} if "delay" in values else values),
    )
    with pytest.raises(VerificationFailed) as caught:
        one.device.write(project=2, step_1_delay=0.25)
    assert "step_1_delay: 250 -> 1" in caught.value.expected
    assert not [frame for frame in one.sent() if frame.startswith(SAVE_2)]


@pytest.mark.parametrize("number", [1, 2])
def test_lost_acknowledgement_of_a_save_is_saved_again_with_all_edits(number: int) -> None:
    with bench(PICK) as one:
        lost = iter([True])
        one.line.change = lambda data: b"" if data[2] == 0x2E and next(lost, False) else data
        program = Program(project=replace(PICK, number=number, stop_mode=0))
        assert one.device.write_project(program).proof == "saved"
        assert stored(one, number).stop_mode == 0
        assert sum(frame.startswith("FF AA 2E") for frame in one.sent()) == 2


def test_supply_lost_before_the_save_never_stores_another_project(one: Bench) -> None:
    def cut(data: bytes) -> bytes:
        if one.line.request[2] == 0x3E and one.simulated.store.working.stop_mode == 0 and len(data) == 226:
            one.line.change = lambda data: data
            one.simulated.power_cycle()  # project 1 is selected again
        return data

    one.line.change = cut
    before = one.simulated.store.stored[1]
    assert one.device.write_project(Program(project=replace(PICK, stop_mode=0))).proof == "saved"
    assert stored(one, 2) == replace(PICK, stop_mode=0)
    assert one.simulated.store.stored[1] == before


def test_unsaved_edits_are_lost_at_power_off_and_saved_by_another_write(one: Bench) -> None:
    assert one.device.write(project=2, save=False, step_1_delay=0.25).proof == "edited"
    assert one.device.read_raw("step_1_delay", project=2) == {"step_1_delay": 250}
    assert one.device.write(project=2, step_1_delay=0.25).proof == "saved"
    assert stored(one, 2) == PICK.with_step(1, delay=250)
    assert one.device.write(project=2, step_1_delay=0.25).proof == "unchanged"
    one.device.write(project=2, save=False, step_1_delay=0.1)
    assert stored(one, 2) == PICK.with_step(1, delay=250)


def test_write_is_in_the_journal_only_as_a_question(one: Bench) -> None:
    one.device.write(project=2, step_1_delay=0.25)
    assert [entry.state for entry in one.told(JournalEntry)] == [ASKED]
    assert one.told(Progress)[-1][:2] == (2, 2)
    one.journal(JournalEntry("jog", INTENT, {"node": 1}))
    for write in (
        lambda: one.device.write(project=2, step_1_delay=0.5),
        lambda: one.device.clear(2),
        lambda: one.device.backup(),
        lambda: one.device.run(2),
    ):
        with pytest.raises(RequestError, match="unfinished"):
            write()


# -- clear, back up, restore -------------------------------------------------------------------------------------------


def test_clear_empties_a_project_and_keeps_project_1(one: Bench) -> None:
    one.device.clear(2)
    assert stored(one, 2) == Project()
    one.sent()
    one.device.clear(2)
    assert {frame[6:8] for frame in one.sent()} == {"3E"}, "nothing is left to clear"
    with pytest.raises(RequestError, match="project 1"):
        one.device.clear(1)
    one.device.clear(1, expert=True)
    assert stored(one, 1) == Project()


def test_clear_without_an_acknowledgement_is_repeated_once(one: Bench) -> None:
    lost = iter([True])
    one.line.change = lambda data: b"" if data[2] == 0x1E and next(lost, False) else data
    one.device.clear(2)
    one.simulated.put(2, PICK)
    one.line.change = lambda data: b"" if data[2] == 0x1E else data
    with pytest.raises(OutcomeUnknown):
        one.device.clear(2)


@pytest.mark.parametrize("order", ["little", "big"])
def test_backup_is_restored_with_every_step(order: str) -> None:
    with bench(PICK, dump_order=order) as one:
        beyond = replace(PICK, number=4, total_steps=1)
        one.simulated.put(4, beyond)
        kept = one.device.backup()
        assert kept.projects == (1, 2, 3, 4)
        first = one.simulated.store.stored[1]
        for number in (1, 2, 3, 4):
            one.simulated.put(number, made(number=number))
        parsed = Backup.parse(kept.text())
        assert [written.proof for written in one.device.restore(parsed)] == ["saved"] * 4
        assert {number: stored(one, number) for number in (1, 2, 3, 4)} == {
            1: first,
            2: PICK,
            3: Project(),
            4: beyond,
        }


def test_failed_restore_names_what_was_restored(one: Bench) -> None:
    kept = Backup(dumps={number: one.device.dump(number) for number in (2, 4)})
    one.simulated.put(2, made(number=2))
    one.simulated.put(4, made(number=4))
    one.line.change = lambda data: b"" if data[2] == 0x1E else data
    with pytest.raises(MotorbusError) as caught:
        one.device.restore(kept)
    assert caught.value.__notes__[-1] == "restored: 2"
    one.sent()
    bad = Backup(dumps={2: b"\xff\xaa\x3e\x02\x00\x00" + encode_image(replace(PICK, mode4=9))})
    with pytest.raises(RequestError, match="mode4"):
        one.device.restore(bad)
    assert one.sent() == []


# -- cached projects ---------------------------------------------------------------------------------------------------


def test_manual_motion_leaves_within_50_ms_where_project_1_is_known() -> None:
    with bench(made(), pace=True) as one:
        one.device.dump(1)
        one.sent()
        start = one.link.now()
        one.device.jog_forward(0.1)
        assert one.sent()[:2] == ["FF AA 00 0B 01 00 00 00 00 00 B5", "FF AA 03 0A 00 00 00 00 00 00 B6"]
        acknowledged = next(at for at, data in one.line.replies if data[2:4] == b"\x03\x0a")
        assert acknowledged - start < 0.050


def test_known_project_is_read_again_after_a_write_a_missing_reply_and_a_restart() -> None:
    with bench(made()) as one:
        one.device.dump(1)
        one.device.set_step_delay(1, 5)
        one.sent()
        one.device.jog_forward(0.1)
        assert sum(frame.startswith("FF AA 3E 01") for frame in one.sent()) == 2
        one.line.change = lambda data: b""
        with pytest.raises(MotorbusError):
            one.device.read_input(1)
        one.line.change = lambda data: data
        one.simulated.put(1, made(Step(distance=1600, speed=30, start_frequency=400, acceleration=100)))
        assert one.device.jog_forward(0.1).velocity == pytest.approx(3.14159, 1e-4)
