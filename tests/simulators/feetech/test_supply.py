"""One supply for all: the sag by hand, who falls first, and what is left of a servo that fell."""

from __future__ import annotations

import pytest

from tests.simulators.feetech.host import ALL, PING, SYNC_WRITE, Host, packet, word

TORQUE, POSITION = 40, 42


def holding(*torques: float, **options: object) -> Host:
    """As many servos as torques, each holding its place against one."""
    host = Host(tuple(range(1, len(torques) + 1)), goal_at_power_up="present", **options)
    for id, torque in enumerate(torques, start=1):
        host.write(id, TORQUE, 1)
        host.bus.nodes[id].torque = torque
    return host


def thresholds(host: Host) -> list[float]:
    return [servo.threshold for servo in host.bus.servos]


def test_the_sag_by_hand() -> None:
    # 0.4 and 0.2 of 3.25 A are 1.95 A; over 0.5 ohm 0.975 V of 7.4
    host = holding(0.4, -0.2, supply_resistance=0.5)
    assert host.bus.nodes[1].voltage == pytest.approx(6.425)
    assert (host.read(1, 62, 1), host.read(2, 62, 1)) == (64, 64)
    host.write(1, TORQUE, 0)
    assert host.read(2, 62, 1) == 71


def test_without_resistance_nothing_sags() -> None:
    host = holding(0.9, 0.9)
    assert (host.bus.nodes[1].voltage, host.read(2, 62, 1)) == (7.4, 74)


def test_it_sags_while_they_turn_and_no_longer() -> None:
    host = Host((1, 2), supply_resistance=2.0)
    host.say(packet(ALL, SYNC_WRITE, POSITION, 2, 1, *word(3000), 2, *word(1000)))
    host.wait(0.1)
    assert host.read(1, 62, 1) == 68  # 0.15 A each: 0.6 V
    host.wait(1.0)
    assert host.read(1, 62, 1) == 74


def test_a_deep_sag_raises_the_voltage_alarm_of_all() -> None:
    host = holding(0.9, 0.9, supply_resistance=1.0)  # 5.85 V less
    assert (host.bus.nodes[1].error, host.bus.nodes[2].error) == (1, 1)


def test_too_low_a_supply_starts_a_servo_anew() -> None:
    host = holding(0.0, 0.0, supply_resistance=1.0, brown_out=5.0, brown_out_spread=0.0)
    first, second = host.bus.servos
    second.memory["acceleration"] = first.memory["acceleration"] = 9
    lives = first.lives
    first.torque = 0.8
    assert first.voltage == pytest.approx(4.8)  # 2.6 A; nothing has happened yet: the moment is now
    host.wait(0.0)
    # both are below 5 V; of equal thresholds the first goes first, and that saves the second
    assert (first.lives, first.memory["torque_enable"], first.memory["acceleration"]) == (lives + 1, 0, 0)
    assert (second.memory["torque_enable"], second.memory["acceleration"]) == (1, 9)
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]  # its id answers again
    assert host.read(1, 62, 1) == 74


def test_it_falls_in_the_middle_of_a_movement_at_the_moment_of_the_stall() -> None:
    host = Host(supply_resistance=1.0, brown_out=5.0, brown_out_spread=0.0)
    servo = host.bus.nodes[1]
    servo.blocked = (0.0, 2548.0)
    host.write(1, POSITION, *word(3000), 0, 0, *word(1000))
    hit = 1.0 + 0.5 + 0.5 * 1000 / 25_400
    host.wait(100.0)
    assert servo.motion.start == pytest.approx(hit)
    assert (servo.memory["torque_enable"], servo.memory["goal_velocity"], servo.raw_position) == (0, 0, 2548)


def test_each_has_its_own_threshold_and_the_seed_decides() -> None:
    first = thresholds(Host((1, 2, 3, 4), brown_out=5.0, seed=1))
    assert all(4.8 <= volts <= 5.2 for volts in first)
    assert len(set(first)) == 4
    assert thresholds(Host((1, 2, 3, 4), brown_out=5.0, seed=1)) == first
    assert thresholds(Host((1, 2, 3, 4), brown_out=5.0, seed=2)) != first


def test_a_subset_falls_and_saves_the_others() -> None:
    options = {"supply_resistance": 0.5, "brown_out": 5.0, "seed": 3}
    # six times 0.3 * 3.25 A over 0.5 ohm: 2.925 V of 7.4; with one less 2.4375, and 4.96 V suffice for some
    host = holding(0.3, 0.3, 0.3, 0.3, 0.3, 0.3, **options)
    host.wait(1.0)
    fallen = [servo.id for servo in host.bus.servos if not servo.memory["torque_enable"]]
    by_threshold = sorted(host.bus.servos, key=lambda servo: -servo.threshold)
    assert 0 < len(fallen) < 6
    assert set(fallen) == {servo.id for servo in by_threshold[: len(fallen)]}
    volts = host.bus.nodes[1].voltage
    assert all(volts >= servo.threshold for servo in host.bus.servos)


def test_below_its_threshold_it_stays_dead_and_comes_back_by_itself() -> None:
    host = Host(brown_out=5.0, brown_out_spread=0.0)
    servo = host.bus.nodes[1]
    lives = servo.lives
    servo.voltage = 4.9
    host.wait(1.0)
    assert host.say(packet(1, PING)) == []
    host.wait(10.0)
    assert servo.lives == lives + 1
    servo.voltage = 5.0
    host.wait(0.1)
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]
    servo.voltage = 4.9
    host.wait(0.1)
    assert servo.lives == lives + 2


def test_torque_stays_off_after_it_whatever_a_power_up_does() -> None:
    host = Host(brown_out=5.0, brown_out_spread=0.0, supply_resistance=1.0, torque_at_power_up="yes")
    servo = host.bus.nodes[1]
    servo.torque = 0.9
    host.wait(1.0)
    assert servo.memory["torque_enable"] == 0
    servo.power_cycle()
    assert servo.memory["torque_enable"] == 1


def test_what_was_being_stored_is_lost() -> None:
    host = Host(brown_out=5.0, brown_out_spread=0.0, torn="old", eeprom_commit="after_ack")
    servo = host.bus.nodes[1]
    host.write(1, 55, 0)
    host.write(1, 13, 60)
    host.wait(0.01)
    servo.voltage = 4.0
    host.wait(0.0)
    servo.voltage = 7.4
    host.wait(1.0)
    assert servo.memory["max_temperature"] == 70
