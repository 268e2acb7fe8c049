"""Registers and EEPROM: rights, lock, power-off in the middle of a store, factory values."""

from __future__ import annotations

from itertools import product

import pytest

from motorbus.core.register import Register, Storage
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.sts import STS
from motorbus.families.feetech.simulator.memory import Cell, Memory, code
from motorbus.families.feetech.simulator.servo import FEEDBACK
from tests.simulators.feetech.host import LOCK, READ, RESTORE, WRITE, Host, packet

SPECIAL = ("id", "second_id", "baud_rate", "lock", "return_delay", "status_return_level")
"""Rows whose change would silence the servo, or that gate what is tested."""


class Slow:
    """The memory of an STS servo with a clock; a write to the EEPROM takes 20 ms."""

    def __init__(self, torn: str = "erased") -> None:
        self.now = 0.0
        self.memory = Memory(STS, {"id": 9}, lambda: self.now, 0.02, torn)


def writable(row: Register) -> bool:
    return row.writable or row.name == "max_acceleration"  # lerobot writes it


def other_value(row: Register, now: int) -> int:
    """A value that the row allows and does not have."""
    if row.name == "torque_enable":
        return 1
    return row.high if now != row.high else row.low


@pytest.mark.parametrize("name", TABLES)
def test_only_a_write_with_the_lock_open_outlasts_a_power_cycle(name: str) -> None:
    rows = [row for row in TABLES[name].values() if row.name not in SPECIAL and writable(row)]
    for row, lock in product(rows, (0, 1)):
        host = Host((1,), name)
        before = host.servo.memory[row.name]
        wanted = other_value(row, before)
        host.write(1, LOCK[name], lock)
        host.write(1, row.address, *row.encode(wanted))
        (reply,) = host.say(packet(1, READ, row.address, row.size))
        assert row.decode(bytes.fromhex(reply)[5:-1]) == wanted, row.name
        assert lock == 0 or host.servo.memory.waiting == []
        host.wait(1.0).servo.power_cycle()
        kept = not lock and row.storage is Storage.EEPROM
        assert host.servo.memory[row.name] == (wanted if kept else before), f"{row.name}, lock {lock}"
        assert host.servo.memory["lock"] == 1


@pytest.mark.parametrize("name", TABLES)
def test_addresses_without_a_row_read_0_and_keep_nothing(name: str) -> None:
    host, table = Host((1,), name), TABLES[name]
    before = host.read(1, 3, 1)
    host.write(1, 3, 99)  # the model, read-only
    assert host.read(1, 3, 1) == before
    covered = {row.address + place for row in table.values() for place in range(row.size)}
    for address in set(range(256)) - covered:
        host.write(1, address, 7)
        assert host.read(1, address, 1) == 0
    host.say(packet(1, WRITE, 254, *bytes(10)))  # beyond the last address
    read_only = {row.name for row in table.values() if row.storage is Storage.RAM and not row.writable}
    assert read_only - set(FEEDBACK) <= {"current_zero_offset"}  # 0: no source explains it


@pytest.mark.parametrize(
    ("row", "value", "data"),
    [
        ("present_position", -2, "02 80"),
        ("present_position", 40_000, "FF 7F"),
        ("present_load", -500, "F4 05"),
        ("present_voltage", 300, "FF"),
        ("present_voltage", -1, "00"),
        ("homing_offset", -1652, "74 0E"),
    ],
)
def test_value_is_cut_to_what_its_row_can_express(row: str, value: int, data: str) -> None:
    assert code(STS[row], value) == bytes.fromhex(data)


def test_part_of_a_row_and_rows_of_both_kinds_in_one_write() -> None:
    host = Host()
    host.write(1, 43, 4)
    assert host.read(1, 42) == 0x0400
    host.write(1, 2, 9, 9, 9, 1, 0, 25)  # 2, 3 and 4 are read-only
    assert [host.read(1, address, 1) for address in (2, 3, 4, 7)] == [0, 9, 3, 25]


@pytest.mark.parametrize(("switch", "mode", "torque"), [("store", 9, 20), ("drop", 0, 20)])
def test_value_out_of_range_is_stored_or_dropped(switch: str, mode: int, torque: int) -> None:
    host = Host(out_of_range=switch)
    assert host.write(1, 33, 9, 20) == ["FF FF 01 02 00 FC"]
    assert (host.read(1, 33, 1), host.read(1, 34, 1)) == (mode, torque)


# -- EEPROM ----------------------------------------------------------------------------------------


def test_live_value_first_then_cell_after_cell() -> None:
    slow = Slow()
    assert slow.memory.write(13, b"\x41\x50", locked=False) == {"max_temperature", "max_voltage"}
    assert (slow.memory["max_temperature"], slow.memory.stored[13]) == (65, 70)
    assert slow.memory.waiting == [Cell(0.0, 0.01, 13, 65), Cell(0.01, 0.02, 14, 80)]
    slow.now = 0.01
    assert (slow.memory.stored[13], slow.memory.wear) == (65, {13: 1})
    slow.memory.write(55, b"\x01", locked=False)  # the lock is closed meanwhile
    slow.memory.write(15, b"\x30", locked=False)  # stored behind the others
    slow.now = 0.02
    assert slow.memory.waiting == [Cell(0.02, 0.04, 15, 0x30)]
    slow.now = 0.04
    assert slow.memory.wear == {13: 1, 14: 1, 15: 1}
    assert (slow.memory.waiting, slow.memory.busy_until) == ([], float("-inf"))


@pytest.mark.parametrize(("torn", "second"), [("erased", 255), ("old", 80), ("new", 90)])
def test_power_cut_tears_the_cell_in_work(torn: str, second: int) -> None:
    slow = Slow(torn)
    slow.memory.write(13, b"\x41\x5a\x20", locked=False)
    slow.now = 0.01
    slow.memory.power_off()
    slow.memory.restart()
    found = [slow.memory[name] for name in ("max_temperature", "max_voltage", "min_voltage")]
    assert found == [65, second, 40]
    assert slow.memory.waiting == []
    slow.memory.write(13, b"\x42\x5b", locked=False)
    slow.memory.restart()  # without a power cut it loses nothing
    assert (slow.memory["max_temperature"], slow.memory["max_voltage"]) == (66, 91)
    slow.now = 0.02
    slow.memory.power_off()  # between two cells it tears none
    assert bytes(slow.memory.stored[13:15]) == bytes((66, second))


@pytest.mark.parametrize("torn", ["erased", "old"])
def test_torn_id_is_the_shipped_one_after_power_up(torn: str) -> None:
    host = Host((7,), torn=torn)
    host.write(7, 55, 0)
    host.bus.receive(packet(7, WRITE, 5, 9), host.now)
    assert host.servo.midway() == pytest.approx(host.now + 0.01)
    host.wait(0.01).servo.power_cycle()
    assert host.servo.id == (1 if torn == "erased" else 7)
    assert host.servo.memory.stored[5] == (255 if torn == "erased" else 7)


@pytest.mark.parametrize("name", TABLES)
def test_factory_restore_brings_back_all_but_the_id(name: str) -> None:
    host = Host((4,), name)
    shipped = bytes(host.servo.memory.stored)
    host.write(4, LOCK[name], 0)
    for address in (6, 13, 19, 20, 21):
        host.write(4, address, 1)
    assert host.say(packet(4, RESTORE)) == ["FF FF 04 02 00 F9"]
    assert host.servo.baud_rate == Host((4,), name).servo.baud_rate
    assert host.wait(0.49).write(4, 13, 1) == []  # not received
    assert host.wait(0.02).write(4, 41, 1) == ["FF FF 04 02 00 F9"]
    assert bytes(host.servo.memory.stored) == shipped
    assert Host(factory_restore="no").say(packet(1, RESTORE)) == []
