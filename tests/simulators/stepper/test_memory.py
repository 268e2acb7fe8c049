"""What is kept, what is edited, and what the supply takes, without a line in between."""

from __future__ import annotations

from motorbus.families.stepper.simulator.memory import EXAMPLE, Memory, Rows
from motorbus.families.stepper.simulator.switches import Switches
from motorbus.families.stepper.table import BLANK, TABLE, decode_image, encode_image
from tests.protocol.stepper.vectors import DUMP_A


def test_the_examples_of_the_manual_are_dump_a() -> None:
    assert encode_image(EXAMPLE) == DUMP_A[6:]
    assert Memory(Switches()).image(1) == DUMP_A[6:]
    assert Memory(Switches(shipped="empty")).image(1) == BLANK


def test_bytes_that_nobody_knows_survive_an_edit_and_a_save() -> None:
    memory = Memory(Switches())
    memory.stored[2] = bytes(12) + b"\x12\x34" + bytes(206)
    memory.edit("select_project", {"project": 2, "total_steps": 1})
    memory.edit("set_project_loop", {"project_loop": 9})
    image = memory.as_saved(2)
    assert image[12:14] == b"\x12\x34"
    assert decode_image(image).project_loop == 9


def test_clearing_what_is_edited_clears_the_copy_too() -> None:
    memory = Memory(Switches())
    memory.edit("set_project_loop", {"project_loop": 9})
    memory.clear(2)
    assert memory.project(1).project_loop == 9
    memory.clear(1)
    assert memory.image(1) == memory.stored[1] == BLANK


def test_restarting_brings_back_what_is_stored() -> None:
    memory = Memory(Switches(flags_scope="device", selected_at_boot=2))
    memory.edit("set_stop_mode", {"stop_mode": 1})
    memory.edit("select_project", {"project": 4, "total_steps": 2})
    memory.restart()
    assert (memory.selected, memory.flags["stop_mode"], memory.image(4)) == (2, 0, BLANK)
    memory.edit("set_stop_mode", {"stop_mode": 1})
    memory.save(2, memory.as_saved(2))
    memory.restart()
    assert memory.flags["stop_mode"] == 1
    assert memory.project(3).stop_mode == 1


def test_rows_are_those_of_the_table() -> None:
    rows = Rows(Memory(Switches()))
    assert list(rows) == list(TABLE)
    assert {name: rows[name] for name in ("step_1_speed", "step_angle", "turn_distance")} == {
        "step_1_speed": 100,
        "step_angle": 180,
        "turn_distance": 1,
    }
