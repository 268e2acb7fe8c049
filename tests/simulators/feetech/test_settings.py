"""Modes, units, directions and limits of every map, by what a host reads while the shaft turns."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.table import CONTROL, TABLES, Mode
from tests.simulators.feetech.host import READ, Host, big, packet, word
from tests.simulators.feetech.test_maps import USUAL, host_of

ALIKE = ("sts", "smbl", "smcl", "hls")
"""Maps with a mode register, little-endian, 4096 counts."""
MODE = {"sts": 33, "smbl": 33, "smcl": 35, "hls": 33}
TORQUE, ACCELERATION, GOAL, DUTY, VELOCITY, LIMIT = 40, 41, 42, 44, 46, 48
PRESENT, PRESENT_VELOCITY, MOVING = 56, 58, 66
HALF_SPEED = {"sts": 1700, "smbl": 1700, "smcl": 1700, "hls": 34}
"""1700 counts/s in the unit of each map."""


def scs(**options: object) -> Host:
    return Host((1,), "scs0009", **options)


# Position.


@pytest.mark.parametrize("name", ALIKE)
def test_position_mode_needs_torque_and_a_velocity(name: str) -> None:
    host = host_of(name, goal_enables_torque="no")
    host.write(1, GOAL, *word(1000))
    host.write(1, VELOCITY, *word(HALF_SPEED[name]))
    assert host.wait(3.0).read(1, PRESENT) == 2048
    host.write(1, TORQUE, 1)
    assert host.wait(0.3).read(1, PRESENT_VELOCITY) == HALF_SPEED[name] | 0x8000
    assert host.wait(3.0).read(1, PRESENT) == 1000


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize(("switch", "maps"), [("by_map", {"sts"}), ("yes", set(TABLES)), ("no", set())])
def test_who_switches_torque_on_by_a_goal(name: str, switch: str, maps: set[str]) -> None:
    host = host_of(name, goal_enables_torque=switch)
    host.write(1, GOAL, 0, 0)
    assert host.read(1, TORQUE, 1) == (name in maps)


@pytest.mark.parametrize(("name", "reached"), [("sts", 1000), ("smbl", 1000), ("smcl", 2048), ("hls", 2048)])
def test_what_a_velocity_of_0_means_as_shipped(name: str, reached: int) -> None:
    host = host_of(name)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(1000))
    assert host.wait(3.0).read(1, PRESENT) == reached
    host = host_of(name, zero_velocity="maximum")
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(1000))
    assert host.wait(3.0).read(1, PRESENT) == 1000


def test_torque_values_other_than_1_are_off() -> None:
    for name in TABLES:
        for value in (0, 2, 3):
            host = host_of(name)
            host.write(1, TORQUE, value)
            assert host.bus.nodes[1].available == 0.0


@pytest.mark.parametrize("name", ["scs", "scs2", "hls"])
def test_128_is_no_order_where_the_middle_is_set_otherwise(name: str) -> None:
    host = host_of(name, position=300)
    host.write(1, TORQUE, 128)
    order = TABLES[name]["present_position"].order
    assert host.read(1, TORQUE, 1) == 128
    assert host.read(1, PRESENT, 2, "big" if order == "big" else "little") == 300


@pytest.mark.parametrize("name", ["sts", "smbl", "smcl"])
def test_128_calls_the_present_pose_the_middle(name: str) -> None:
    host = host_of(name, position=3000)
    host.write(1, TORQUE, 128)
    assert host.read(1, PRESENT) == 2048
    assert host.read(1, TABLES[name]["homing_offset"].address) == 952


# Many turns.


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
@pytest.mark.parametrize(("goal", "reached"), [(-5_000, -5_000), (32_000, 30_719), (-32_000, -30_719)])
def test_both_limits_0_are_many_turns_up_to_seven_and_a_half(name: str, goal: int, reached: int) -> None:
    host = host_of(name, position=100, zero_velocity="maximum")
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, 18, host.read(1, 18, 1) | 16)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(goal))
    assert host.wait(30.0).read(1, PRESENT) == int.from_bytes(word(reached), "little")
    host = host_of(name, position=100, zero_velocity="maximum", beyond_limits="stay")
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, 18, host.read(1, 18, 1) | 16)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(goal))
    assert host.wait(30.0).read(1, PRESENT) == int.from_bytes(
        word(goal if goal == reached else 100), "little"
    )


def test_an_angular_resolution_of_3_stretches_positions_over_three_turns() -> None:
    host = Host(position=0)
    host.write(1, 30, 3)
    host.write(1, GOAL, *word(4000))
    assert host.wait(10.0).read(1, PRESENT) == 4000
    assert host.bus.nodes[1].motion.position(host.now) == 12_000
    host.bus.nodes[1].raw_position = 10
    assert host.read(1, PRESENT) == 10
    host = Host(position=0, angular_resolution="ignore")
    host.write(1, 30, 3)
    host.write(1, GOAL, *word(4000))
    host.wait(10.0)
    assert host.bus.nodes[1].motion.position(host.now) == 4000


# Velocity, PWM, current.


@pytest.mark.parametrize("name", ALIKE)
def test_velocity_mode_in_the_unit_of_the_map(name: str) -> None:
    host = host_of(name, position=0)
    host.write(1, MODE[name], 1)
    host.write(1, TORQUE, 1)
    host.write(1, VELOCITY, *word(-HALF_SPEED[name]))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == HALF_SPEED[name] | 0x8000
    assert host.bus.nodes[1].motion.velocity(host.now) == -1700
    host.write(1, VELOCITY, 0, 0)
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 0


def test_the_phase_decides_about_the_unit_on_sts_and_smbl_alone() -> None:
    for name, counts in {"sts": 1000, "smbl": 1000, "smcl": 20, "hls": 1000}.items():
        host = host_of(name)
        host.write(1, 18, 0)
        host.write(1, MODE[name], 1)
        host.write(1, TORQUE, 1)
        host.write(1, VELOCITY, *word(20))
        host.wait(1.0)
        assert host.bus.nodes[1].motion.velocity(host.now) == counts


@pytest.mark.parametrize(
    ("switch", "negative"), [("by_map", {"sts"}), ("smaller", set(ALIKE)), ("larger", set())]
)
def test_which_way_a_positive_duty_turns(switch: str, negative: set[str]) -> None:
    for name in ALIKE:
        host = host_of(name, positive_duty=switch)
        host.write(1, MODE[name], CONTROL[name].code(Mode.PWM) or 0)
        host.write(1, TORQUE, 1)
        host.write(1, DUTY, *word(500, 15 if name == "hls" else 10))
        host.wait(1.0)
        assert host.bus.nodes[1].motion.velocity(host.now) == (-1700 if name in negative else 1700)


def test_which_register_takes_the_duty_of_an_hls_is_a_switch() -> None:
    host = host_of("hls", hls_duty="goal_velocity")
    host.write(1, MODE["hls"], 3)
    host.write(1, TORQUE, 1)
    host.write(1, DUTY, *word(500))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 0
    host.write(1, VELOCITY, *word(500))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == HALF_SPEED["hls"]


def test_a_mode_that_nobody_explains_rests_or_is_position() -> None:
    for switch, reached in (("rest", 2048), ("position", 1000)):
        host = host_of("hls", unknown_mode=switch)
        host.write(1, MODE["hls"], 4)
        host.write(1, TORQUE, 1)
        host.write(1, GOAL, *word(1000), *word(300), *word(40))
        assert host.wait(3.0).read(1, PRESENT) == reached


def test_constant_current_turns_whoever_is_free() -> None:
    host = host_of("hls")
    host.write(1, MODE["hls"], 2)
    host.write(1, DUTY, 0, 0)
    host.write(1, TORQUE, 1)
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 0
    host.write(1, DUTY, *word(-100))
    assert host.wait(5.0).read(1, PRESENT_VELOCITY) == 68 | 0x8000


@pytest.mark.parametrize("mode", [0, 1])
def test_a_goal_torque_of_0_is_a_trap_on_hls(mode: int) -> None:
    host = host_of("hls")
    assert host.read(1, DUTY) == 500  # from the protection current, at power-up
    host.write(1, MODE["hls"], mode)
    host.write(1, TORQUE, 1)
    host.write(1, ACCELERATION, 50, *word(1000), 0, 0, *word(40))  # the burst that suits an STS
    assert host.wait(5.0).read(1, PRESENT) == 2048
    assert host.read(1, MOVING, 1) == 2  # at rest, and its goal not reached
    host.write(1, DUTY, *word(500))
    assert host.wait(5.0).read(1, PRESENT) != 2048


def test_bit_1_of_moving_tells_on_hls_that_the_goal_is_not_reached() -> None:
    host = host_of("hls")
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(1000))
    host.write(1, VELOCITY, *word(40))
    assert host.wait(0.1).read(1, MOVING, 1) == 3
    assert host.wait(3.0).read(1, MOVING, 1) == 0


# Offset.


@pytest.mark.parametrize(
    ("name", "offset", "sign_bit"), [("smbl", -1652, 11), ("smcl", 500, 11), ("hls", -4000, 15)]
)
def test_the_offset_holds_in_position_mode_alone(name: str, offset: int, sign_bit: int) -> None:
    host = host_of(name, position=1000)
    host.write(1, TABLES[name]["homing_offset"].address, *word(offset, sign_bit))
    assert host.read(1, PRESENT) == (1000 - offset) % 4096
    host.write(1, MODE[name], 1)
    assert host.read(1, PRESENT) == 1000


def test_the_offset_of_scs2_is_one_byte_and_holds_while_the_limits_are_not_0() -> None:
    host = Host((1,), "scs215-2", position=500)
    host.write(1, 34, 100)
    assert host.read(1, PRESENT, 2, "big") == 400
    host.write(1, 34, 100 | 0x80)
    assert host.read(1, PRESENT, 2, "big") == 600
    host.write(1, 9, 0, 0, 0, 0)
    assert host.read(1, PRESENT, 2, "big") == 500


# SCS.


def test_scs_goes_to_a_goal_at_a_speed_high_byte_first() -> None:
    host = scs(position=100)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *big(900), *big(0), *big(400))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY, 2, "big") == 400
    assert host.wait(3.0).read(1, PRESENT, 2, "big") == 900


def test_little_endian_words_are_another_goal_for_scs() -> None:
    host = scs(position=100)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(900), *word(0), *word(400))
    assert host.read(1, GOAL, 2, "big") == 0x8403  # and no checksum can tell
    assert host.wait(20.0).read(1, PRESENT, 2, "big") == 1003  # as far as the limit


@pytest.mark.parametrize("time", [500, 2000])
def test_scs_takes_the_time_it_is_given_when_the_speed_is_0(time: int) -> None:
    host = scs(position=100)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *big(900), *big(time), *big(0))
    assert host.wait(time / 1000 - 0.01).read(1, MOVING, 1) == 1
    assert host.wait(0.011).read(1, MOVING, 1) == 0
    assert host.read(1, PRESENT, 2, "big") == 900


@pytest.mark.parametrize(
    ("switch", "maps"), [("by_map", {"scs", "scs2"}), ("heed", set(TABLES) - {"hls"}), ("ignore", set())]
)
def test_who_heeds_a_time(switch: str, maps: set[str]) -> None:
    for name, table in TABLES.items():
        host = host_of(name, goal_time=switch, position=100)
        host.write(1, 18, 0)  # a velocity of 0 means standstill: nothing but the time moves it
        host.write(1, TORQUE, 1)
        for row, raw in {"goal_position": 900, "goal_time": 500}.items():
            if row in table:
                host.write(1, table[row].address, *table[row].encode(raw))
        host.wait(1.0)
        assert (host.bus.nodes[1].raw_position == 900) == (name in maps), name


def test_scs_with_neither_speed_nor_time_does_what_its_phase_says() -> None:
    for phase, reached in ((0, 100), (8, 900)):
        host = scs(position=100)
        host.write(1, 18, phase)
        host.write(1, TORQUE, 1)
        host.write(1, GOAL, *big(900))
        assert host.wait(3.0).read(1, PRESENT, 2, "big") == reached


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_both_limits_0_make_a_motor_of_scs(name: str) -> None:
    host = host_of(name)
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, TORQUE, 1)
    host.write(1, DUTY, *big(-500, 10))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY, 2, "big") == 1024 | 0x8000
    assert host.read(1, 60, 2, "big") == 500 | 0x400
    host.write(1, 9, *big(20), *big(1003))
    assert host.wait(20.0).read(1, PRESENT_VELOCITY, 2, "big") == 0


def test_scs_tells_no_current_and_scs2_does() -> None:
    for name, tells in (("scs", False), ("scs2", True)):
        host = host_of(name)
        host.write(1, 9, 0, 0, 0, 0)
        host.write(1, TORQUE, 1)
        host.write(1, DUTY, *big(500, 10))
        assert bool(host.wait(1.0).read(1, 69, 2, "big")) is tells


@pytest.mark.parametrize("name", ["smcl", "scs", "scs2"])
def test_max_torque_bounds_the_torque_where_no_torque_limit_is(name: str) -> None:
    host = host_of(name)
    host.write(1, TORQUE, 1)
    assert host.bus.nodes[1].available == 1.0
    host.write(1, 16, 0, 0)
    assert host.bus.nodes[1].available == 0.0


# Direction.


def test_both_direction_bits_turn_an_sts_round() -> None:
    host = Host(position=1000)
    host.write(1, 18, 12 + 128 + 1)
    assert host.read(1, PRESENT) == 3096
    host.write(1, GOAL, *word(3196))
    assert host.wait(2.0).read(1, PRESENT) == 3196
    assert host.bus.nodes[1].motion.position(host.now) == 900
    host.bus.nodes[1].raw_position = 3000
    assert host.read(1, PRESENT) == 3000
    host.write(1, MODE["sts"], 1)
    host.write(1, VELOCITY, *word(1000))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 1000
    assert host.bus.nodes[1].motion.velocity(host.now) == -1000
    assert host.read(1, 60) == 294


@pytest.mark.parametrize("bit", [1, 128])
def test_one_of_them_alone_makes_it_run_away_or_is_made_up_for(bit: int) -> None:
    host = Host(position=2048)
    host.write(1, 18, 12 + bit)
    host.write(1, GOAL, *word(2100))
    assert host.wait(3.0).read(1, PRESENT_VELOCITY) == 3400 | 0x8000
    host = Host(position=2048, half_reversed="follow")
    host.write(1, 18, 12 + bit)
    host.write(1, GOAL, *word(2100))
    assert host.wait(3.0).read(1, PRESENT) == 2100


def test_a_reversed_drive_reverses_the_duty() -> None:
    for bits, velocity in ((0, 1700 | 0x8000), (1, 1700), (128, 1700), (129, 1700 | 0x8000)):
        host = Host()
        host.write(1, 18, 12 + bits)
        host.write(1, MODE["sts"], 2)
        host.write(1, TORQUE, 1)
        host.write(1, DUTY, *word(500, 10))
        assert host.wait(1.0).read(1, PRESENT_VELOCITY) == velocity


@pytest.mark.parametrize(("name", "bit"), [("scs", 1), ("scs2", 1), ("hls", 128)])
def test_a_single_direction_bit_turns_drive_and_feedback(name: str, bit: int) -> None:
    host = host_of(name, position=300)
    servo = host.bus.nodes[1]
    host.write(1, 18, bit)
    told = servo.raw_position
    assert told == -300 % CONTROL[name].turn
    row = TABLES[name]["goal_position"]
    host.write(1, TORQUE, 1)
    host.write(1, VELOCITY, *TABLES[name]["goal_velocity"].encode(40))
    host.write(1, GOAL, *row.encode(told + 50))
    host.wait(5.0)
    assert (servo.raw_position, servo.motion.position(host.now)) == (told + 50, 250)


def test_the_units_of_every_map_are_those_of_its_rows() -> None:
    for name, model in USUAL.items():
        servo = Host((1,), model).bus.nodes[1]
        assert servo.asked.unit == (50 if name == "hls" else 1)


def test_a_read_of_everything_works_in_every_mode() -> None:
    for name, control in CONTROL.items():
        for code in [*control.modes] or [0]:
            host = host_of(name)
            if control.modes:
                host.write(1, MODE[name], code)
            host.write(1, TORQUE, 1)
            assert len(host.wait(0.5).say(packet(1, READ, 0, 100))) == 1


@pytest.mark.parametrize("name", TABLES)
def test_bit_4_of_phase_counts_turns_where_it_has_that_meaning(name: str) -> None:
    host = host_of(name, position=300)
    host.write(1, 18, 16)
    servo = host.bus.nodes[1]
    servo.raw_position -= 400
    assert servo.raw_position == (-100 if name in ("sts", "smbl", "hls") else CONTROL[name].turn - 100)
