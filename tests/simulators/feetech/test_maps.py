"""Every row of every map, by what a host reads and writes: rights, byte order, lock, power cycle, alarms."""

from __future__ import annotations

import random
from itertools import product

import pytest

from motorbus.core.register import Register, Storage
from motorbus.families.feetech.simulator.feedback import FEEDBACK
from motorbus.families.feetech.table import TABLES, alarms
from tests.simulators.feetech.host import ALL, READ, WRITE, Host, packet

USUAL = {
    "sts": "sts3215", "smbl": "sm85blhv", "smcl": "sm80-360m", "scs": "scs0009", "scs2": "scs215-2", "hls": "hls3925",
}  # fmt: skip
LOCK = {"sts": 55, "smbl": 55, "hls": 55, "smcl": 48, "scs": 48, "scs2": 48}
SPECIAL = {"id", "second_id", "baud_rate", "lock", "return_delay", "status_return_level"}
"""Rows whose change would make the test lose its servo, or that gate what it is about."""


def host_of(name: str, **options: object) -> Host:
    return Host((1,), USUAL[name], **options)


def other_value(row: Register, now: int) -> int:
    """A value the row allows and does not have."""
    wanted = row.high if now != row.high else row.low
    return 1 if row.name == "torque_enable" else wanted


def raw(host: Host, row: Register) -> int:
    (reply,) = host.say(packet(1, READ, row.address, row.size))
    return row.decode(bytes.fromhex(reply)[5:-1])


def test_there_is_a_model_for_each_map() -> None:
    assert {name: Host((1,), model).bus.nodes[1].model.table.name for name, model in USUAL.items()} == {
        name: name for name in TABLES
    }


def settable(row: Register) -> bool:
    return row.writable or row.name == "max_acceleration"  # lerobot writes it


@pytest.mark.parametrize("name", TABLES)
def test_a_row_that_may_be_written_is_read_back_and_another_is_not(name: str) -> None:
    for row in (row for row in TABLES[name].values() if row.name not in SPECIAL):
        host = host_of(name, half_reversed="follow")
        before = raw(host, row)
        wanted = other_value(row, before)
        (acknowledged,) = host.write(1, row.address, *row.encode(wanted))
        assert acknowledged.startswith("FF FF 01 02"), row.name
        assert raw(host, row) == (wanted if settable(row) else before), row.name


@pytest.mark.parametrize("name", TABLES)
def test_a_locked_write_is_lost_at_power_off_and_an_unlocked_one_is_kept(name: str) -> None:
    rows = [row for row in TABLES[name].values() if row.name not in SPECIAL and settable(row)]
    for row, lock in product(rows, (0, 1)):
        keeps = not lock and row.storage is Storage.EEPROM
        host = host_of(name, half_reversed="follow")
        servo = host.bus.nodes[1]
        before = servo.memory[row.name]
        wanted = other_value(row, before)
        host.write(1, LOCK[name], lock)
        host.write(1, row.address, *row.encode(wanted))
        host.wait(1.0)
        servo.power_cycle()
        assert servo.memory[row.name] == (wanted if keeps else before), f"{row.name}, lock {lock}"


@pytest.mark.parametrize("name", TABLES)
def test_the_lock_itself_is_closed_again_by_a_power_cycle(name: str) -> None:
    host = host_of(name)
    assert host.read(1, LOCK[name], 1) == 1
    host.write(1, LOCK[name], 0)
    assert host.read(1, LOCK[name], 1) == 0
    host.bus.nodes[1].power_cycle()
    assert host.read(1, LOCK[name], 1) == 1


@pytest.mark.parametrize("name", TABLES)
def test_every_address_can_be_read_and_where_no_row_is_there_are_zeros(name: str) -> None:
    host = host_of(name)
    table = TABLES[name]
    covered = {row.address + place for row in table.values() for place in range(row.size)}
    image = [*bytes.fromhex(host.say(packet(1, READ, 0, 128))[0])[5:-1]]
    image += bytes.fromhex(host.say(packet(1, READ, 128, 128))[0])[5:-1]
    assert {address for address, value in enumerate(image) if value} <= covered


@pytest.mark.parametrize("name", TABLES)
def test_every_reading_has_its_row_and_rows_of_feedback_their_reading(name: str) -> None:
    read_only = {row.name for row in TABLES[name].values() if row.storage is Storage.RAM and not row.writable}
    assert read_only - set(FEEDBACK) <= {"current_zero_offset"}  # which is 0: no source says what it is for


@pytest.mark.parametrize("name", TABLES)
def test_telemetry_in_the_byte_order_of_the_map(name: str) -> None:
    host = host_of(name, position=513)
    order = TABLES[name]["present_position"].order
    assert host.say(packet(1, READ, 56, 2))[0].split()[5:7] == (
        ["02", "01"] if order == "big" else ["01", "02"]
    )


@pytest.mark.parametrize("name", TABLES)
def test_heat_and_voltage_raise_the_alarms_of_every_map(name: str) -> None:
    host = host_of(name)
    servo = host.bus.nodes[1]
    servo.temperature, servo.voltage = 101.0, 1.0
    assert host.read(1, 65, 1) == 0x05
    assert servo.status()["alarm"] == ["voltage", "temperature"] == list(alarms(0x05, name))
    assert servo.available == 0.0  # temperature is in the unload mask of each


@pytest.mark.parametrize("name", TABLES)
def test_0x06_brings_back_what_was_shipped(name: str) -> None:
    host = host_of(name)
    servo = host.bus.nodes[1]
    shipped = bytes(servo.memory.stored)
    host.write(1, LOCK[name], 0)
    for address in (13, 19, 20, 21):
        host.write(1, address, 1)
    assert host.say(packet(1, 0x06)) == ["FF FF 01 02 00 FC"]
    host.wait(2.0)
    assert bytes(servo.memory.stored) == shipped


@pytest.mark.parametrize("seed", range(4))
def test_whatever_is_written_and_done_to_it_a_mixed_bus_goes_on(seed: int) -> None:
    dice = random.Random(seed)
    host = Host((1, 2, 3, 4, 5, 6), "+".join(USUAL.values()))
    instructions = (WRITE, WRITE, WRITE, READ, 0x04, 0x05, 0x06, 0x08, 0x0A, 0x0B)
    for _ in range(400):
        servo = dice.choice(host.bus.servos)
        id, address = dice.choice((servo.id, servo.id, ALL)), dice.randrange(7, 88)
        data = dice.randbytes(dice.choice((1, 2, 4, 7)))
        host.wait(dice.random() / 5).say(packet(id, dice.choice(instructions), address, *data))
        host.say(packet(servo.id, WRITE, 40, dice.choice((0, 1, 1, 2, 128))))
        servo.torque, servo.voltage = dice.uniform(-1, 1), dice.uniform(3, 15)
        assert servo.status()["model"] == servo.model.name
    for servo in host.bus.servos:
        servo.torque, servo.voltage = 0.0, servo.model.voltage
        servo.power_cycle()
    for id in range(1, 7):
        assert len(host.wait(5.0).say(packet(id, READ, 0, 90))) == 1
