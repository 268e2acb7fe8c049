"""Torque, the four operating modes and the homing offset, by what a host reads while the shaft turns."""

from __future__ import annotations

import pytest

from tests.simulators.feetech.host import (
    Host,
    word,
)

MODE, TORQUE, ACCELERATION, GOAL, DUTY, VELOCITY, LIMIT, LOCK = 33, 40, 41, 42, 44, 46, 48, 55
PRESENT, PRESENT_VELOCITY, MOVING = 56, 58, 66


def moving_host(**options: object) -> Host:
    """Servo 1 on its way from 1000 to 3000 at 1000 counts/s since 1 s, and far from any ramp."""
    host = Host(position=1000, **options)
    host.write(1, GOAL, *word(3000), 0, 0, *word(1000))
    return host.wait(1.0)


# Torque.


def test_it_starts_limp_in_the_middle_and_locked() -> None:
    host = Host()
    assert (host.read(1, TORQUE, 1), host.read(1, PRESENT), host.read(1, LOCK, 1)) == (0, 2048, 1)
    assert host.read(1, MOVING, 1) == 0


def test_writing_the_goal_switches_torque_on_and_moves() -> None:
    host = Host()
    host.write(1, GOAL, *word(1000))
    assert host.read(1, TORQUE, 1) == 1
    assert host.wait(2.0).read(1, PRESENT) == 1000


@pytest.mark.parametrize("address", [31, 41, 46, 55])
def test_writing_other_registers_does_not_switch_torque_on(address: int) -> None:
    host = Host()
    host.write(1, address, 1)
    assert host.read(1, TORQUE, 1) == 0


def test_a_goal_may_leave_torque_alone() -> None:
    host = Host(goal_enables_torque="no")
    host.write(1, GOAL, *word(1000))
    assert host.read(1, TORQUE, 1) == 0
    assert host.wait(2.0).read(1, PRESENT) == 2048
    host.write(1, TORQUE, 1)
    assert host.wait(2.0).read(1, PRESENT) == 1000


def test_torque_on_without_a_goal_jumps_to_0() -> None:
    host = Host()
    host.write(1, TORQUE, 1)
    assert host.wait(2.0).read(1, PRESENT) == 0


def test_goal_at_power_up_may_be_the_present_position() -> None:
    host = Host(position=1304, goal_at_power_up="present")
    assert host.read(1, GOAL) == 1304
    host.write(1, TORQUE, 1)
    assert host.wait(2.0).read(1, PRESENT) == 1304


@pytest.mark.parametrize("value", [0, 2])
def test_torque_off_goes_limp_where_it_is(value: int) -> None:
    host = moving_host()
    there = host.read(1, PRESENT)
    assert 1900 < there < 2000
    host.write(1, TORQUE, value)
    assert (host.read(1, PRESENT_VELOCITY), host.read(1, MOVING, 1)) == (0, 0)
    assert host.wait(5.0).read(1, PRESENT) == there
    assert host.read(1, TORQUE, 1) == value


@pytest.mark.parametrize("raw", [0, 1])
def test_a_torque_limit_of_nothing_makes_it_limp(raw: int) -> None:
    host = moving_host()
    there = host.read(1, PRESENT)
    host.write(1, LIMIT, *word(raw))
    assert host.wait(5.0).read(1, PRESENT) == there
    host.write(1, LIMIT, *word(500))
    assert host.wait(5.0).read(1, PRESENT) == 3000


def test_torque_at_power_up_holds_where_it_stands() -> None:
    host = Host(torque_at_power_up="yes", position=700)
    assert host.read(1, TORQUE, 1) == 1
    assert host.wait(2.0).read(1, PRESENT) == 700


# Position mode.


def test_a_new_goal_on_the_way_takes_over_without_a_jump() -> None:
    host = moving_host()
    before = host.read(1, PRESENT)
    host.write(1, GOAL, *word(1500), 0, 0, *word(1000))
    assert host.read(1, PRESENT) == before
    assert host.read(1, PRESENT_VELOCITY) == 1000
    assert host.wait(0.01).read(1, PRESENT) > before  # it brakes first
    assert host.wait(5.0).read(1, PRESENT) == 1500


def test_acceleration_is_in_hundreds_of_counts() -> None:
    host = Host(position=0)
    host.write(1, ACCELERATION, 5, *word(4000), 0, 0, *word(1000))  # 500 counts/s² up to 1000 counts/s
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 500
    assert host.read(1, PRESENT) == 250
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 1000


def test_the_acceleration_unit_as_measured() -> None:
    host = Host(position=0, acceleration_unit=104)
    host.write(1, ACCELERATION, 5, *word(4000), 0, 0, *word(1000))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 520


def test_speed_0_is_full_speed_as_shipped_and_nothing_without_phase_bit_3() -> None:
    host = Host(position=0)
    host.write(1, GOAL, *word(4000))
    assert host.wait(0.5).read(1, PRESENT_VELOCITY) == 3400
    host = Host(position=0)
    host.write(1, 18, 4)
    host.write(1, GOAL, *word(4000))
    assert host.wait(0.5).read(1, PRESENT) == 0


def test_without_phase_bit_2_speed_counts_in_fifties() -> None:
    host = Host(position=0)
    host.write(1, 18, 8)
    host.write(1, GOAL, *word(4000), 0, 0, *word(20))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 20
    assert 900 < host.read(1, PRESENT) < 1000


def test_nothing_is_faster_than_the_motor() -> None:
    host = Host(position=0)
    host.write(1, GOAL, *word(4000), 0, 0, *word(30000))
    assert host.wait(0.5).read(1, PRESENT_VELOCITY) == 3400


@pytest.mark.parametrize(("goal", "reached"), [(500, 1000), (3500, 3000), (2000, 2000), (-5, 1000)])
def test_a_goal_beyond_the_limits_goes_as_far_as_the_limit(goal: int, reached: int) -> None:
    host = Host()
    host.write(1, 9, *word(1000), *word(3000))
    host.write(1, GOAL, *word(goal))
    assert host.wait(3.0).read(1, PRESENT) == reached
    assert host.read(1, GOAL) == int.from_bytes(bytes(word(goal)), "little")


def test_a_goal_beyond_the_limits_may_be_ignored() -> None:
    host = Host(beyond_limits="stay")
    host.write(1, 9, *word(1000), *word(3000))
    host.write(1, GOAL, *word(500))
    assert host.wait(3.0).read(1, PRESENT) == 2048


def test_it_never_crosses_the_seam() -> None:
    host = Host(position=4095)
    host.write(1, GOAL, *word(0))
    assert host.wait(0.6).read(1, PRESENT) in range(1900, 2300)  # the long way
    assert host.wait(2.0).read(1, PRESENT) == 0


def test_both_limits_0_and_full_turns_count_on() -> None:
    host = Host(position=100)
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, 18, 12 + 16)
    host.write(1, GOAL, *word(10_000))
    assert host.wait(10.0).read(1, PRESENT) == 10_000
    host.write(1, GOAL, *word(-5_000))
    assert host.wait(10.0).read(1, PRESENT) == 5_000 | 0x8000
    host.bus.nodes[1].power_cycle()  # the turn count is lost
    assert host.read(1, PRESENT) == (-5_000) % 4096


# Other modes.


def test_the_wheel_turns_and_stops() -> None:
    host = Host(position=0)
    host.write(1, MODE, 1)
    host.write(1, VELOCITY, *word(-1000))
    assert host.wait(1.0).read(1, PRESENT) == 0  # limp
    host.write(1, TORQUE, 1)
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 1000 | 0x8000
    assert host.read(1, MOVING, 1) == 1
    assert 3096 <= host.read(1, PRESENT) < 3200  # almost -1000, in one turn
    host.write(1, VELOCITY, *word(0))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 0
    assert host.read(1, MOVING, 1) == 0


def test_a_mode_takes_effect_at_once_even_when_locked_and_is_lost() -> None:
    host = moving_host()
    host.write(1, MODE, 1)
    assert host.wait(5.0).read(1, PRESENT_VELOCITY) == 1000
    host.bus.nodes[1].power_cycle()
    assert host.read(1, MODE, 1) == 0


def test_a_goal_in_wheel_mode_does_not_switch_torque_on() -> None:
    host = Host()
    host.write(1, MODE, 1)
    host.write(1, GOAL, *word(1000))
    assert host.read(1, TORQUE, 1) == 0


def test_positive_duty_turns_towards_smaller_angles() -> None:
    host = Host()
    host.write(1, MODE, 2)
    host.write(1, TORQUE, 1)
    host.write(1, DUTY, *word(500, sign_bit=10))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 1700 | 0x8000
    host.write(1, DUTY, *word(-250, sign_bit=10))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 850


def test_step_mode_moves_again_with_each_write() -> None:
    host = Host(position=1000)
    host.write(1, MODE, 3)
    for place in (1100, 1200):
        host.write(1, GOAL, *word(100))
        assert host.wait(1.0).read(1, PRESENT) == place
    host.write(1, GOAL, *word(-300))
    assert host.wait(1.0).read(1, PRESENT) == 900


@pytest.mark.parametrize(("switch", "reached"), [("goal", 3000), ("present", 2500)])
def test_a_step_on_the_way_counts_from_the_goal_or_from_here(switch: str, reached: int) -> None:
    host = Host(position=1000, step_from=switch, full_acceleration=1e12)
    host.write(1, MODE, 3)
    host.write(1, VELOCITY, *word(1000))
    host.write(1, GOAL, *word(1000))
    host.wait(0.5).write(1, GOAL, *word(1000))
    assert host.wait(5.0).read(1, PRESENT) == reached


def test_in_step_mode_other_writes_do_not_step() -> None:
    host = Host(position=1000)
    host.write(1, MODE, 3)
    host.write(1, GOAL, *word(1000), 0, 0, *word(1000))
    host.wait(0.5).write(1, VELOCITY, *word(500))
    assert host.wait(5.0).read(1, PRESENT) == 2000
    host.write(1, TORQUE, 0)
    host.write(1, TORQUE, 1)
    assert host.wait(5.0).read(1, PRESENT) == 2000


def test_the_offset_counts_in_position_mode_only() -> None:
    host = Host(position=2048)
    host.write(1, 31, *word(85, sign_bit=11))
    assert host.read(1, PRESENT) == 1963
    host.write(1, MODE, 1)
    assert host.read(1, PRESENT) == 2048
    host.write(1, MODE, 0)
    assert host.read(1, PRESENT) == 1963


def test_a_negative_offset_wraps_within_the_turn() -> None:
    host = Host(position=4000)
    host.write(1, 31, *word(-1652, sign_bit=11))
    assert host.read(1, PRESENT) == (4000 + 1652) % 4096


def test_goals_are_in_what_is_read() -> None:
    host = Host(position=2048)
    host.write(1, 31, *word(500, sign_bit=11))
    host.write(1, GOAL, *word(1548))
    assert not host.bus.nodes[1].motion.moving(host.now)
    host.write(1, GOAL, *word(3000))
    assert host.wait(3.0).read(1, PRESENT) == 3000
