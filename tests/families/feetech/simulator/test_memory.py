"""Bytes by rows: what is kept, what is dropped, what a row makes of a number."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.simulator.memory import Layout, Memory, Written, code
from motorbus.families.feetech.table import STS


@pytest.fixture
def memory() -> Memory:
    return Memory(Layout(STS, {"id": 9}))


def test_it_begins_as_the_rows_say_and_as_the_model_differs(memory: Memory) -> None:
    assert (memory["id"], memory["max_position_limit"], memory["phase"]) == (9, 4095, 12)


def test_where_no_register_is_there_are_zeros(memory: Memory) -> None:
    assert memory.write(50, b"\x07\x08", locked=False).names == frozenset()
    assert memory.read(50, 2) == b"\0\0"
    assert memory.read(255, 3) == b"\0\0\0"


def test_half_a_row_can_be_written(memory: Memory) -> None:
    assert memory.write(43, b"\x04", locked=True).names == {"goal_position"}
    assert memory["goal_position"] == 0x0400


def test_a_write_runs_off_the_end_without_harm(memory: Memory) -> None:
    assert memory.write(254, bytes(10), locked=False).names == frozenset()


def test_a_write_tells_what_it_touched_and_whether_it_was_stored(memory: Memory) -> None:
    assert memory.write(13, b"\x41\x50", locked=True) == Written(
        frozenset({"max_temperature", "max_voltage"}), False
    )
    assert memory.write(13, b"\x41\x50", locked=False) == Written(
        frozenset({"max_temperature", "max_voltage"}), True
    )
    assert memory.write(41, b"\x01", locked=False) == Written(frozenset({"acceleration"}), False)


def test_strict_drops_the_rows_that_do_not_fit_and_takes_the_others(memory: Memory) -> None:
    assert memory.write(33, b"\x09\x14", locked=True, strict=True).names == {"protective_torque"}
    assert memory["operating_mode"] == 0


def test_storing_one_row(memory: Memory) -> None:
    memory["homing_offset"] = -5
    memory.store("homing_offset")
    memory.power_up()
    assert memory["homing_offset"] == -5


def test_factory_rows_can_be_read_and_not_written(memory: Memory) -> None:
    assert memory.write(80, b"\x05", locked=False).names == frozenset()


@pytest.mark.parametrize(
    ("row", "raw", "data"),
    [
        ("present_position", -2, "02 80"),
        ("present_position", 40_000, "FF 7F"),
        ("present_load", -500, "F4 05"),
        ("present_voltage", 300, "FF"),
        ("present_voltage", -1, "00"),
        ("homing_offset", -1652, "74 0E"),
    ],
)
def test_a_number_as_bytes_cut_to_what_the_row_can_say(row: str, raw: int, data: str) -> None:
    assert code(STS[row], raw) == bytes.fromhex(data)
