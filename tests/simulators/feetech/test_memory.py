"""Bytes by rows: what is kept, what is dropped, what a row makes of a number."""

from __future__ import annotations

import random

import pytest

from motorbus.core.register import Coding, Storage
from motorbus.families.feetech.simulator.flash import Commit, Flash
from motorbus.families.feetech.simulator.memory import Layout, Memory, Written, code
from motorbus.families.feetech.table import STS, TABLES


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


# What takes its time: see test_flash.py for the cells themselves.


class Slow:
    """A memory whose EEPROM needs 20 ms for a write, and a clock for it."""

    def __init__(self) -> None:
        self.now = 0.0
        layout = Layout(STS, {"id": 9})
        flash = Flash(layout.factory, clock=lambda: self.now, time=0.02)
        self.memory = Memory(layout, flash)


def test_with_the_lock_open_the_live_byte_is_first_and_the_stored_one_follows() -> None:
    slow = Slow()
    slow.memory.write(13, b"\x41\x50", locked=False)
    assert slow.memory["max_temperature"] == 65
    assert slow.memory.stored[13] == 70
    assert slow.memory.commits == [Commit(0.01, 13, 65), Commit(0.02, 14, 80)]
    slow.now = 0.01
    assert (slow.memory.stored[13], slow.memory.wear) == (65, {13: 1})


def test_a_locked_write_persists_nothing() -> None:
    slow = Slow()
    slow.memory.write(13, b"\x41", locked=True)
    slow.now = 1.0
    assert (slow.memory.commits, slow.memory.stored[13], slow.memory.wear) == ([], 70, {})
    slow.memory.power_up()
    assert slow.memory["max_temperature"] == 70


def test_a_power_cut_leaves_what_was_committed_and_a_restart_all() -> None:
    for cut, second in ((True, 80), (False, 90)):
        slow = Slow()
        slow.memory.write(13, b"\x41\x5a", locked=False)
        slow.now = 0.01
        if cut:
            slow.memory.power_up()
        else:
            slow.memory.restart()
        assert (slow.memory["max_temperature"], slow.memory["max_voltage"]) == (65, second)


def test_closing_the_lock_while_storing() -> None:
    slow = Slow()
    slow.memory.write(55, b"\0", locked=True)
    slow.memory.write(13, b"\x41", locked=False)
    slow.memory.write(55, b"\x01", locked=False)
    slow.now = 1.0
    assert slow.memory.stored[13] == 65


def test_an_impossible_id_or_rate_is_mended_on_wish() -> None:
    for mend, found in ((True, (9, 0)), (False, (255, 255))):
        slow = Slow()
        slow.memory.stored[5:7] = b"\xff\xff"
        slow.memory.power_up(mend=mend)
        assert (slow.memory["id"], slow.memory["baud_rate"]) == found
        assert slow.memory.stored[5:7] == b"\xff\xff"  # it is not written back


def test_a_restore_of_the_factory_values_takes_its_time_too() -> None:
    slow = Slow()
    slow.memory.write(13, b"\x41", locked=False)
    slow.now = 1.0
    slow.memory.restore_factory(frozenset({"id"}), 1.0)
    assert slow.memory["max_temperature"] == 70
    assert slow.memory.stored[13] == 65
    assert {commit.address for commit in slow.memory.commits} == set(range(6, 40))
    slow.now = 2.0
    assert (slow.memory.stored[13], slow.memory.commits) == (70, [])


@pytest.mark.parametrize("name", TABLES)
def test_a_write_does_the_same_as_one_row_by_row(name: str) -> None:
    chance = random.Random(name)
    layout = Layout(TABLES[name], {})
    quick = Memory(layout)
    live = bytearray(quick.live)
    for _ in range(3000):
        address, data = chance.randrange(256), chance.randbytes(chance.randrange(12))
        locked = chance.random() < 0.5
        names, stored = set(), False
        for row in layout.touched(address, len(data)):
            if row.writable or row.name == "max_acceleration":
                names.add(row.name)
                stored |= row.storage is Storage.EEPROM and not locked
                for place in range(row.address, row.address + row.size):
                    if address <= place < address + len(data):
                        live[place] = data[place - address]
        assert quick.write(address, data, locked=locked) == Written(frozenset(names), stored)
        assert quick.live == live


@pytest.mark.parametrize("name", TABLES)
def test_every_row_is_read_and_told_as_its_coding_says(name: str) -> None:
    chance = random.Random(name)
    memory = Memory(Layout(TABLES[name], {}))
    for row in TABLES[name].values():
        for raw in (0, 1, -1, 255, 256, -256, 0x7FFF, 0x8000, 1 << 20, chance.randrange(-40000, 40000)):
            memory[row.name] = raw
            span = slice(row.address, row.address + row.size)
            assert bytes(memory.live[span]) == code(row, raw)
            memory.live[span] = chance.randbytes(row.size)
            assert memory[row.name] == row.decode(bytes(memory.live[span]))
    assert any(row.coding is Coding.SIGN_MAGNITUDE for row in TABLES[name].values())


def test_whoever_works_with_the_registers_learns_of_every_change() -> None:
    memory = Memory(Layout(STS, {}))
    changes = [
        lambda: memory.write(40, b"\1", locked=True),
        lambda: memory.write(33, b"\0", locked=True, strict=True),
        lambda: memory.__setitem__("torque_enable", 0),
        lambda: memory.restore_factory(frozenset()),
        memory.power_up,
        memory.restart,
    ]
    for change in changes:
        memory.settled = True
        change()
        assert not memory.settled
    memory.settled = True
    memory.tell("present_position", 5)
    assert memory.settled
    assert memory["present_position"] == 5
