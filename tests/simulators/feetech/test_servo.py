"""What a write, an alarm, a calibration or a power cut does to one servo."""

from __future__ import annotations

from math import inf

import pytest

from tests.simulators.feetech.host import (
    ACTION,
    BOOTLOADER,
    CALIBRATE,
    REG_WRITE,
    RESTORE,
    WRITE,
    Host,
    packet,
    word,
)

MODE, TORQUE, ACCELERATION, GOAL, DUTY, VELOCITY, LIMIT, LOCK = 33, 40, 41, 42, 44, 46, 48, 55
PRESENT, PRESENT_VELOCITY, MOVING = 56, 58, 66


def moving_host(**options: object) -> Host:
    """Servo 1 on its way from 1000 to 3000 at 1000 counts/s since 1 s, and far from any ramp."""
    host = Host(position=1000, **options)
    host.write(1, GOAL, *word(3000), 0, 0, *word(1000))
    return host.wait(1.0)


# Calibration.


def test_128_makes_the_present_pose_the_middle() -> None:
    host = Host(position=3000)
    assert host.write(1, TORQUE, 128) == ["FF FF 01 02 00 FC"]
    assert host.read(1, PRESENT) == 2048
    assert host.read(1, 31) == 952
    assert host.read(1, TORQUE, 1) == 0
    assert not host.bus.nodes[1].motion.moving(host.now)


def test_a_second_calibration_takes_the_old_offset_out_first() -> None:
    host = Host(position=3000)
    host.write(1, TORQUE, 128)
    host.write(1, GOAL, *word(1000))
    host.wait(3.0).write(1, TORQUE, 128)
    assert host.read(1, PRESENT) == 2048
    assert host.read(1, 31) == 96 | 0x800  # the encoder is at 1952
    assert host.read(1, TORQUE, 1) == 1
    assert host.wait(3.0).read(1, PRESENT) == 2048  # and it stays


def test_0x0b_with_and_without_a_position() -> None:
    host = Host(position=3000)
    assert host.say("FF FF 01 04 0B 00 04 EB") == ["FF FF 01 02 00 FC"]
    assert host.read(1, PRESENT) == 1024
    host.say(packet(1, CALIBRATE))
    assert host.read(1, PRESENT) == 2048


def test_the_one_offset_that_cannot_be_said_is_one_count_beside() -> None:
    host = Host(position=0)
    host.write(1, TORQUE, 128)
    assert host.read(1, 31) == 2047 | 0x800
    assert host.read(1, PRESENT) == 2047


@pytest.mark.parametrize(("switch", "unlock", "kept"), [("lock", 0, 0), ("lock", 1, 952), ("always", 0, 952)])
def test_what_becomes_of_the_offset_at_power_off(switch: str, unlock: int, kept: int) -> None:
    host = Host(position=3000, calibration_store=switch)
    if unlock:
        host.write(1, LOCK, 0)
    host.write(1, TORQUE, 128)
    host.bus.nodes[1].power_cycle()
    assert host.read(1, 31) == kept


# Lock and power.


def test_the_lock_gates_what_is_kept_and_not_what_is_obeyed() -> None:
    host = Host()
    host.write(1, 13, 65)
    assert host.read(1, 13, 1) == 65
    host.bus.nodes[1].power_cycle()
    assert host.read(1, 13, 1) == 70
    host.write(1, LOCK, 0)
    host.write(1, 13, 66)
    host.write(1, LOCK, 1)
    host.bus.nodes[1].power_cycle()
    assert host.read(1, 13, 1) == 66


def test_unlocking_afterwards_does_not_keep_what_was_written_locked() -> None:
    host = Host()
    host.write(1, 13, 65)
    host.write(1, LOCK, 0)
    host.bus.nodes[1].power_cycle()
    assert host.read(1, 13, 1) == 70


def test_a_power_cycle_takes_ram_back_and_leaves_the_shaft() -> None:
    host = moving_host()
    host.write(1, ACCELERATION, 9)
    there = host.read(1, PRESENT)
    host.bus.nodes[1].power_cycle()
    assert [host.read(1, address, 1) for address in (TORQUE, ACCELERATION, LOCK)] == [0, 0, 1]
    assert (host.read(1, GOAL), host.read(1, VELOCITY), host.read(1, LIMIT)) == (0, 0, 1000)
    assert host.wait(1.0).read(1, PRESENT) == there


def test_the_torque_limit_comes_from_max_torque() -> None:
    host = Host()
    host.write(1, LOCK, 0)
    host.write(1, 16, *word(600))
    assert host.read(1, LIMIT) == 1000
    host.bus.nodes[1].power_cycle()
    assert host.read(1, LIMIT) == 600


def test_the_lock_may_be_open_at_power_up() -> None:
    assert Host(lock_at_power_up="no").read(1, LOCK, 1) == 0


def test_a_servo_may_be_deaf_after_power_up() -> None:
    host = Host(startup_time=0.05)
    assert host.read(1, 5, 1) == 1  # it has been on for long
    host.bus.nodes[1].power_cycle()
    assert host.write(1, ACCELERATION, 1) == []
    assert host.wait(0.06).read(1, 5, 1) == 1


def test_an_id_written_while_locked_is_lost() -> None:
    host = Host()
    host.write(1, 5, 7)
    assert host.read(7, 5, 1) == 7
    host.bus.nodes[7].power_cycle()
    assert list(host.bus.nodes) == [1]


def test_every_stored_byte_is_counted() -> None:
    host = Host()
    memory = host.bus.nodes[1].memory
    host.write(1, 13, 65)
    host.write(1, ACCELERATION, 5)
    assert memory.wear == {}
    host.write(1, LOCK, 0)
    host.write(1, 13, 65)
    host.write(1, 31, 1, 0)
    host.write(1, 13, 65)
    assert memory.wear == {13: 2, 31: 1, 32: 1}


def test_unplugging_stops_and_forgets_as_a_power_cut_does() -> None:
    host = moving_host()
    servo = host.bus.nodes[1]
    there = servo.raw_position
    servo.unplug()
    servo.voltage = 7.0  # nothing brings it to life
    assert host.wait(5.0).bus.nodes[1].raw_position == there
    servo.plug()
    assert host.read(1, TORQUE, 1) == 0
    servo.plug()  # again: nothing
    host.write(1, ACCELERATION, 3)
    servo.plug()
    assert host.read(1, ACCELERATION, 1) == 3


def test_an_unplugged_servo_has_no_supply_to_cycle() -> None:
    host = Host()
    host.bus.nodes[1].unplug()
    host.bus.nodes[1].power_cycle()
    assert host.write(1, ACCELERATION, 3) == []


# REG WRITE.


def test_reg_write_waits_for_action() -> None:
    host = Host()
    host.say(packet(1, REG_WRITE, GOAL, *word(1000)))
    assert (host.read(1, 64, 1), host.read(1, GOAL), host.read(1, TORQUE, 1)) == (1, 0, 0)
    assert host.say(packet(1, ACTION)) == ["FF FF 01 02 00 FC"]
    assert (host.read(1, 64, 1), host.read(1, GOAL), host.read(1, TORQUE, 1)) == (0, 1000, 1)


def test_a_second_reg_write_replaces_the_first() -> None:
    host = Host()
    for place in (1000, 2000):
        assert host.say(packet(1, REG_WRITE, GOAL, *word(place))) == ["FF FF 01 02 00 FC"]
    host.say(packet(1, ACTION))
    assert host.read(1, GOAL) == 2000


def test_a_power_cycle_forgets_the_reg_write() -> None:
    host = Host()
    host.say(packet(1, REG_WRITE, GOAL, *word(1000)))
    host.bus.nodes[1].power_cycle()
    assert host.read(1, 64, 1) == 0
    host.say(packet(1, ACTION))
    assert host.read(1, GOAL) == 0


# Alarms.


def test_a_wrong_supply_raises_the_voltage_alarm_in_every_frame() -> None:
    host = Host()
    host.bus.nodes[1].voltage = 12.1  # above 8.0 V
    assert host.write(1, ACCELERATION, 1) == ["FF FF 01 02 01 FB"]
    assert (host.read(1, 65, 1), host.read(1, 62, 1)) == (1, 121)
    host.write(1, 14, 140)
    assert host.read(1, 65, 1) == 0


def test_heat_and_voltage_show_together() -> None:
    host = Host()
    host.bus.nodes[1].voltage, host.bus.nodes[1].temperature = 3.9, 71.0
    assert (host.read(1, 65, 1), host.read(1, 63, 1)) == (0x05, 71)


def test_an_alarm_in_the_unload_mask_drops_the_torque_until_it_goes() -> None:
    host = moving_host()
    there = host.read(1, PRESENT)
    host.bus.nodes[1].alarm = 0x20
    assert host.wait(3.0).read(1, PRESENT) == there
    host.bus.nodes[1].alarm = 0
    assert host.wait(3.0).read(1, PRESENT) == 3000


def test_an_alarm_outside_the_unload_mask_does_not() -> None:
    host = moving_host()
    host.bus.nodes[1].alarm = 0x10
    assert host.wait(3.0).read(1, PRESENT) == 3000


def test_heat_drops_the_torque() -> None:
    host = moving_host()
    there = host.read(1, PRESENT)
    host.bus.nodes[1].temperature = 90.0
    assert host.wait(3.0).read(1, PRESENT) == there


def test_a_power_cycle_clears_an_alarm() -> None:
    host = Host()
    host.bus.nodes[1].alarm = 0x20
    host.bus.nodes[1].power_cycle()
    assert host.bus.nodes[1].alarm == 0


# Factory restore and bootloader.


def test_0x06_restores_everything_but_the_id() -> None:
    host = Host((4,))
    host.write(4, LOCK, 0)
    host.write(4, 13, 65)
    host.write(4, 31, 100, 0)
    host.write(4, 5, 9)
    host.say(packet(9, RESTORE))
    host.wait(1.1)
    assert [host.read(9, 13, 1), host.read(9, 31)] == [70, 0]
    host.bus.nodes[9].power_cycle()
    assert [host.read(9, 13, 1), host.read(9, 5, 1)] == [70, 9]


def test_0x06_may_set_the_id_to_1() -> None:
    host = Host((4,), restore_id="default")
    host.say(packet(4, RESTORE))
    assert host.wait(1.1).read(1, 5, 1) == 1


def test_0x06_goes_back_to_the_factory_rate() -> None:
    host = Host()
    host.write(1, LOCK, 0)
    host.write(1, 6, 4)
    host.bus.tune(115_200)
    assert host.say(packet(1, RESTORE)) == ["FF FF 01 02 00 FC"]
    host.wait(1.1)
    assert host.write(1, ACCELERATION, 1) == []
    host.bus.tune(1_000_000)
    assert host.write(1, ACCELERATION, 1) == ["FF FF 01 02 00 FC"]


def test_in_the_bootloader_it_is_limp() -> None:
    host = moving_host()
    there = host.read(1, PRESENT)
    host.say(packet(1, BOOTLOADER))
    assert host.wait(1.0).read(1, PRESENT) == there


# Rights.


@pytest.mark.parametrize("address", [0, 2, 3, 56, 60, 62, 66, 84, 86])
def test_read_only_registers_acknowledge_and_do_not_change(address: int) -> None:
    host = Host()
    before = host.read(1, address, 1)
    assert host.write(1, address, before ^ 1) == ["FF FF 01 02 00 FC"]
    assert host.read(1, address, 1) == before


def test_max_acceleration_keeps_what_is_written_until_power_off() -> None:
    host = Host()
    assert host.read(1, 85, 1) == 254
    assert host.write(1, 85, 100) == ["FF FF 01 02 00 FC"]
    assert host.read(1, 85, 1) == 100
    host.bus.nodes[1].power_cycle()
    assert host.read(1, 85, 1) == 254


def test_a_write_over_both_kinds_changes_what_may_be() -> None:
    host = Host()
    host.write(1, 2, 9, 9, 9, 1, 0, 25)  # 2, 3, 4 are fixed; 5, 6, 7 are not
    assert [host.read(1, address, 1) for address in (2, 3, 4, 7)] == [0, 9, 3, 25]


def test_values_out_of_range_are_stored_or_dropped() -> None:
    host = Host()
    host.write(1, 33, 9)
    assert host.read(1, 33, 1) == 9
    host = Host(out_of_range="drop")
    assert host.write(1, 33, 9) == ["FF FF 01 02 00 FC"]
    assert host.read(1, 33, 1) == 0


# What a person sees.


def test_status() -> None:
    host = moving_host()
    host.bus.nodes[1].alarm = 0x11
    status = host.bus.nodes[1].status()
    assert status == {
        "id": 1,
        "model": "sts3215",
        "plugged": True,
        "baud_rate": 1_000_000,
        "raw_position": host.read(1, PRESENT),
        "raw_goal_position": 3000,
        "torque_enabled": True,
        "moving": True,
        "locked": True,
        "alarm": ["voltage", "angle"],
        "voltage": 7.4,
        "temperature": 30.0,
    }


def test_the_shaft_can_be_turned_by_hand() -> None:
    host = Host()
    host.bus.nodes[1].raw_position = 1304
    assert host.read(1, PRESENT) == 1304
    assert host.bus.nodes[1].raw_position == 1304


# What its registers ask for.


def test_goals_and_readings_change_nothing_of_what_the_other_registers_ask() -> None:
    host = moving_host()
    servo = host.bus.nodes[1]
    asked = servo.asked
    host.write(1, GOAL, *word(1200))
    host.read(1, PRESENT, 15)
    assert servo.asked is asked  # so it is not worked out again for every goal


@pytest.mark.parametrize("address", [MODE, ACCELERATION, DUTY, VELOCITY, LIMIT, 9, 11, 16, 18, 30])
def test_every_other_register_is_heeded_as_soon_as_it_is_written_or_poked(address: int) -> None:
    host = moving_host()
    servo = host.bus.nodes[1]
    asked = servo.asked
    host.write(1, address, 2)
    assert servo.asked is not asked
    servo.memory["max_torque"] = servo.memory["torque_limit"] = 100
    assert servo.asked.limit == 0.1


def test_the_middle_of_a_cell_that_is_stored() -> None:
    host = Host(store_time=0.02)
    servo = host.bus.nodes[1]
    assert servo.midway() == inf
    host.write(1, 55, 0)
    host.wait(1.0)
    host.bus.receive(packet(1, WRITE, 11, 0x10, 0x02), host.now)
    assert servo.midway() == pytest.approx(host.now + 0.005)
    host.wait(0.015)
    assert servo.midway() == pytest.approx(host.now)
    host.wait(0.1)
    assert servo.midway() == inf
