"""The controller by its bytes: 27 commands, a working copy and four slots, what runs, and what nobody can ask for."""

from __future__ import annotations

import json
from math import inf

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.table import TABLE, Project, Step, with_steps
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B, MANUAL, REQUESTS, name_of
from tests.protocol.vectors import Vector
from tests.simulators.stepper.host import (
    CLEAR,
    DONE,
    FORWARD,
    READ,
    SAVE,
    SELECT,
    START,
    STOP,
    STOP_PROJECT,
    Host,
    frame,
    number,
    step,
    written,
)

EXAMPLES = [
    (request, reply)
    for request in MANUAL
    for reply in MANUAL
    if request.id.endswith("-request") and reply.id == request.id.replace("-request", "-reply")
]


@pytest.mark.parametrize(("request_", "reply"), EXAMPLES, ids=name_of)
def test_each_example_of_the_manual_is_answered_as_the_manual_says(request_: Vector, reply: Vector) -> None:
    assert bytes.fromhex(Host().say(request_.data)) == reply.data


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_every_frame_that_is_known_is_answered(vector: Vector) -> None:
    answered = bytes.fromhex(Host().say(vector.data))
    assert answered[:3] == vector.data[:3]
    assert len(answered) in (6, 226) or answered[-2:] == b"\xee\xdd"


def test_a_new_one_holds_the_examples_of_the_manual() -> None:
    host = Host()
    assert host.dump(1) == DUMP_A
    assert host.dump(2) == DUMP_A[:3] + b"\x02" + bytes(222)
    assert Host(shipped="empty").dump(1) == DUMP_A[:6] + bytes(220)


def write_dump_b(host: Host) -> None:
    host.write(
        [
            frame(SELECT, 2, 3),
            frame(3, 1, *number(16, 2), 90),
            frame(3, 2, *number(5000, 3)),
            frame(0x7E, 2, 3, 2),
            frame(0x8E, 3),
            frame(3, 0x0E, 1),
            frame(0x9E, 0),
            frame(0xAE, 0),
            *step(1, distance=10000, start=200, acceleration=100, rpm=60, output=1, delay=500),
            *step(2, distance=56814, direction=1, start=200, acceleration=100, rpm=300, output=5, wait=1),
            *step(3, distance=43775, start=200, acceleration=100, rpm=300, output=8, delay=1000, stop=2),
        ]
    )


def test_a_project_that_is_written_is_read_byte_for_byte() -> None:
    host = Host()
    write_dump_b(host)
    assert host.dump(2) == DUMP_B
    assert host.say(frame(SAVE, 2)) == "FF AA 2E 02 00 00"
    host.device.power_cycle()
    assert host.dump(2) == DUMP_B


def test_dump_b_runs_as_long_as_reckoned_and_tells_its_end_once() -> None:
    host = Host()
    write_dump_b(host)
    host.device.set_input(1, True)
    began = host.now
    assert host.say(frame(START, 2)) == "FF AA 4E 02 00 00"
    ((at, text),) = host.wait(60.0)
    assert text == DONE
    assert at - began == pytest.approx(41.613525, abs=1e-6)
    assert host.device.position == 3 * (12800 - 2 * 72721 + 2 * 56032)


# --- memory --------------------------------------------------------------------------------------------------------


def test_what_is_not_saved_is_lost_with_the_supply() -> None:
    host = Host()
    host.write([frame(SELECT, 1, 1), *step(1, distance=77)])
    assert host.dump(1)[26:29] == bytes(number(77, 3))
    host.device.power_cycle()
    assert host.dump(1) == DUMP_A


def test_selecting_loads_what_is_stored_or_only_renames() -> None:
    edits = [frame(SELECT, 1, 1), frame(3, 2, *number(500, 3)), frame(SELECT, 2, 1)]
    loading = Host()
    loading.write(edits)
    assert loading.dump(2)[15:18] == bytes(3)
    assert loading.dump(1) == DUMP_A
    renaming = Host(select="relabel")
    renaming.write(edits)
    assert renaming.dump(2)[15:18] == bytes(number(500, 3))


def test_selecting_writes_the_number_of_steps_and_keeps_the_rows_behind() -> None:
    host = Host()
    host.write(written(3, step(1), step(2, distance=9)))
    host.write([frame(SAVE, 3), frame(SELECT, 3, 1)])
    dump = host.dump(3)
    assert dump[7] == 1
    assert dump[46:49] == bytes(number(9, 3))


def test_reading_may_show_what_is_stored() -> None:
    host = Host(read_view="stored")
    host.write([frame(SELECT, 1, 1), *step(1, distance=77)])
    assert host.dump(1) == DUMP_A
    host.say(frame(SAVE, 1))
    assert host.dump(1)[26:29] == bytes(number(77, 3))


@pytest.mark.parametrize(("reading", "answered"), [("warn", True), ("allow", True), ("refuse", False)])
def test_saving_as_another_project(reading: str, answered: bool) -> None:
    host = Host(save_cross=reading)
    host.write([frame(SELECT, 1, 1)])
    assert (host.say(frame(SAVE, 4)) != "") is answered
    assert (host.dump(4)[6] == 4) is answered
    assert bool(host.device.log) is (reading != "allow")


@pytest.mark.parametrize(("reading", "kept"), [("old", True), ("empty", False)])
def test_a_save_that_is_cut_by_the_supply(reading: str, kept: bool) -> None:
    host = Host(save_cut=reading, save_time=1.0)
    host.write([frame(SELECT, 1, 1), *step(1, distance=77)])
    assert host.say(frame(SAVE, 1), 0.5) == ""
    host.device.power_cycle()
    assert host.wait(5.0) == []
    assert (host.dump(1) == DUMP_A) is kept
    assert (host.dump(1)[6:] == bytes(220)) is not kept


def test_a_save_that_is_not_cut_is_acknowledged_when_it_is_done() -> None:
    host = Host(save_time=1.0)
    host.write([frame(SELECT, 1, 1), *step(1, distance=77)])
    assert host.timed(frame(SAVE, 1), 2.0) == [(1.002, "FF AA 2E 01 00 00")]
    host.device.power_cycle()
    assert host.dump(1)[26:29] == bytes(number(77, 3))


def test_a_cleared_project_is_zero_and_ends_when_it_is_started() -> None:
    host = Host()
    assert host.say(frame(CLEAR, 1)) == "FF AA 1E 01 00 00"
    assert host.dump(1) == DUMP_A[:6] + bytes(220)
    assert host.say(frame(START, 1)) == f"FF AA 4E 01 00 00 {DONE}"
    assert Host(clear_notice=False, shipped="empty").say(frame(START, 1)) == "FF AA 4E 01 00 00"
    host.say(FORWARD)
    assert host.device.position == 0  # and with it the speed of everything by hand


def test_bytes_of_a_number_may_come_high_one_first() -> None:
    host = Host(dump_order="big")
    host.write([frame(SELECT, 2, 1), frame(3, 1, *number(0x0102, 2), 180)])
    assert host.dump(2)[12:14] == b"\x01\x02"
    assert Host(dump_order="big").dump(1)[12:14] == b"\x00\x08"


def test_flags_may_belong_to_the_device() -> None:
    of_project, of_device = Host(), Host(flags_scope="device")
    for host in (of_project, of_device):
        host.write([frame(SELECT, 2, 1), frame(3, 0x0E, 1), frame(0xAE, 1), frame(0x9E, 2)])
    assert of_project.dump(1)[20:23] == bytes(3)
    assert of_device.dump(1)[20:23] == b"\x01\x02\x01"
    of_device.device.power_cycle()
    assert of_device.dump(1)[20:23] == bytes(3)  # never saved
    of_device.write([frame(0xAE, 1), frame(SAVE, 1)])
    of_device.device.power_cycle()
    assert of_device.device.status()["phase"] == "homing"


def test_which_project_is_selected_at_power_on() -> None:
    host = Host(selected_at_boot=3)
    assert host.say(frame(0x8E, 2)) == "FF AA 8E 03 00 00"
    assert host.device.status()["selected"] == 3


# --- what is not answered -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "data",
    [
        frame(SELECT, 5, 1),
        frame(SELECT, 0, 1),
        frame(SELECT, 1, 11),
        frame(READ, 5),
        frame(3, 3, 1, 0, 0, 0, 0, 11),
        frame(3, 3, 1, 0, 0, 0, 0, 0),
        frame(3, 6, 9, 0, 0, 0, 0, 1),
        frame(3, 8, 6, 0, 0, 0, 0, 1),
        frame(0, 0x0C, 6, 1),
        frame(0, 0x0C, 1, 2),
        frame(0, 0x0B, 0),
        frame(3, 1, 0, 0, 180),
        frame(0x9E, 3),
        frame(5, 0x0D),
        frame(3, 0x10),
        frame(0xBE, 1),
        frame(0, 0x0D),
        frame(3, 0x0D)[:-1] + b"\x00",
    ],
)
def test_what_is_wrong_is_not_answered_and_changes_nothing(data: bytes) -> None:
    host = Host()
    assert host.say(data) == ""
    assert host.device.log
    assert host.dump(1) == DUMP_A
    assert host.device.state.phase.value == "idle"


def test_numbers_out_of_range_may_be_acknowledged_and_are_ignored() -> None:
    host = Host(out_of_range="ack")
    assert host.say(frame(3, 6, 9, 0, 0, 0, 0, 1)) == "FF AA 03 06 00 01"
    assert host.say(frame(3, 6, 1, 0, 0, 0, 0, 11)) == ""  # but not for a step that there is not
    assert host.dump(1) == DUMP_A


def test_steps_behind_the_last_one_are_taken() -> None:
    assert Host().say(frame(3, 6, 1, 0, 0, 0, 0, 10)) == "FF AA 03 06 00 0A"


def test_another_motor_number_may_be_its_own() -> None:
    host = Host(motor=5)
    assert host.say(frame(5, 0x0D)) == "FF AA 05 0D 00 00"
    assert host.say(STOP) == ""
    assert host.say(STOP_PROJECT) == "FF AA 5E 00 00 00"


# --- looking at it ---------------------------------------------------------------------------------------------------


def test_its_status_is_plain_data() -> None:
    host = Host()
    host.write(written(2, step(1), repeat=2))
    host.say(frame(START, 2), 1.5)
    status = json.loads(json.dumps(host.device.status()))
    assert (status["phase"], status["project"], status["step"], status["pass"]) == ("moving", 2, 1, 2)
    assert status["position"] == pytest.approx(2400, abs=4)
    assert status["frequency"] == 1600


def test_its_memory_is_every_row_by_name() -> None:
    host = Host()
    memory = host.device.memory
    assert set(memory) == set(TABLE)
    assert len(memory) == len(TABLE)
    assert (memory["microsteps"], memory["step_angle"], memory["step_1_delay"], memory["step_10_delay"]) == (
        8,
        180,
        1000,
        0,
    )
    host.write([frame(SELECT, 2, 7)])
    assert (memory["number"], memory["total_steps"]) == (2, 7)
    assert memory["step_1_start_frequency"] == 0
    with pytest.raises(RequestError):
        memory["colour"]


def test_a_project_can_be_put_into_it() -> None:
    host = Host()
    made = with_steps(Project(microsteps=8, step_angle=180, turn_distance=1), (Step(distance=5),))
    host.device.put(1, made)
    assert host.dump(1)[6:8] == b"\x01\x01"
    assert host.dump(1)[26] == 5
    with pytest.raises(RequestError, match="no project 5"):
        host.device.put(5, made)


def test_remarks_do_not_grow_for_ever() -> None:
    host = Host()
    for _ in range(1100):
        host.device.remark("again")
    assert len(host.device.log) == 1000


def test_what_happened_does_not_grow_for_ever() -> None:
    host = Host()
    host.write(written(1, step(1, distance=0, delay=1), repeat=255))
    host.say(frame(START, 1), 20.0)
    assert len(host.device.told) == 10_000
    assert host.device.told[-1].at == pytest.approx(host.now, abs=0.002)


def test_the_middle_of_a_save() -> None:
    host = Host(save_time=0.5, turnaround=0.0)
    assert host.device.midway() == inf
    began = host.now
    host.bus.receive(frame(SAVE, 1), began)
    assert host.device.midway() == pytest.approx(began + 0.25)
    host.wait(1.0)
    assert host.device.midway() == inf
