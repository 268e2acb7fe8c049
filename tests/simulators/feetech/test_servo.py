"""One servo by what a host reads: torque, modes, feedback, calibration, alarms, power."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.registers.codes import alarms
from tests.simulators.feetech.host import (
    ACK,
    CALIBRATE,
    CLEAR_TURNS,
    MODELS,
    READ,
    REG_WRITE,
    Host,
    big,
    packet,
    word,
)

MODE, TORQUE, ACCELERATION, GOAL, DUTY, VELOCITY, LIMIT, LOCK = 33, 40, 41, 42, 44, 46, 48, 55
PRESENT, PRESENT_VELOCITY, LOAD, MOVING, CURRENT = 56, 58, 60, 66, 69
OFFSET, PHASE = 31, 18


def moving_host(**options: object) -> Host:
    """A servo 1 s on its way from 1000 to 3000 at 1000 counts/s, far from any ramp."""
    host = Host(position=1000, **options)
    host.write(1, GOAL, *word(3000), 0, 0, *word(1000))
    return host.wait(1.0)


# -- torque ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_writing_the_goal_switches_torque_on_with_sts_only(name: str) -> None:
    host = Host((1,), name)
    host.write(1, VELOCITY, 1)
    assert host.read(1, TORQUE, 1) == 0
    host.write(1, GOAL, *(big(100) if name.startswith("scs") else word(100)))
    assert host.read(1, TORQUE, 1) == (1 if name == "sts" else 0)
    if name in ("scs", "scs2", "hls"):  # 128 means nothing there
        before = host.servo.raw_position
        assert host.write(1, TORQUE, 128) == ACK
        assert (host.servo.raw_position, host.read(1, TORQUE, 1)) == (before, 128)


@pytest.mark.parametrize(("switch", "goes_to"), [("zero", 0), ("present", 1304)])
def test_torque_on_without_a_goal(switch: str, goes_to: int) -> None:
    host = Host(position=1304, goal_at_power_up=switch)
    host.write(1, TORQUE, 1)
    assert host.wait(2.0).read(1, PRESENT) == goes_to
    host = Host(torque_at_power_up="yes", position=700)
    assert (host.read(1, TORQUE, 1), host.wait(2.0).read(1, PRESENT)) == (1, 700)


@pytest.mark.parametrize(
    ("address", "data"), [(TORQUE, (0,)), (TORQUE, (2,)), (LIMIT, (0, 0)), (LIMIT, (1, 0))]
)
def test_without_torque_it_is_limp_where_it_is(address: int, data: tuple[int, ...]) -> None:
    host = moving_host()
    there = host.read(1, PRESENT)
    assert 1900 < there < 2000
    host.write(1, address, *data)
    assert (host.read(1, PRESENT_VELOCITY), host.read(1, MOVING, 1)) == (0, 0)
    assert host.wait(5.0).read(1, PRESENT) == there
    host.write(1, address, *((1,) if address == TORQUE else word(500)))
    assert host.wait(5.0).read(1, PRESENT) == 3000


# -- position mode ---------------------------------------------------------------------------------


def test_acceleration_in_hundreds_of_counts_and_resolution_in_counts_of_a_position() -> None:
    host = Host(position=0)
    host.write(1, ACCELERATION, 5, *word(4000), 0, 0, *word(1000))  # 500 counts/s² up to 1000 counts/s
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 500
    assert host.read(1, PRESENT) == 250
    host = Host(position=1000)
    host.write(1, 30, 2)
    assert host.read(1, PRESENT) == 500
    host.write(1, GOAL, *word(700))
    assert host.wait(3.0).read(1, PRESENT) == 700
    assert host.servo.motion.position(host.now) == 1400


def test_new_goal_on_the_way_takes_over_without_a_jump() -> None:
    host = moving_host()
    before = host.read(1, PRESENT)
    host.write(1, GOAL, *word(1500), 0, 0, *word(1000))
    assert (host.read(1, PRESENT), host.read(1, PRESENT_VELOCITY)) == (before, 1000)
    assert host.wait(0.01).read(1, PRESENT) > before  # it brakes first
    assert host.wait(5.0).read(1, PRESENT) == 1500


@pytest.mark.parametrize(
    ("phase", "velocity", "reads", "counts"),
    [
        (12, 0, 3400, 3400),  # as shipped 0 is the maximum
        (4, 0, 0, 0),  # without bit 3 it is standstill
        (8, 20, 20, 1000),  # without bit 2 in units of 50 counts/s
        (12, 30000, 3400, 3400),  # the motor has no more
    ],
)
def test_velocity_by_phase(phase: int, velocity: int, reads: int, counts: int) -> None:
    host = Host(position=0)
    host.write(1, PHASE, phase)
    host.write(1, GOAL, *word(4000), 0, 0, *word(velocity))
    assert host.wait(0.5).read(1, PRESENT_VELOCITY) == reads
    assert host.servo.motion.velocity(host.now) == counts


@pytest.mark.parametrize(("goal", "reached"), [(500, 1000), (3500, 3000), (2000, 2000), (-5, 1000)])
def test_goal_is_clamped_to_the_limits(goal: int, reached: int) -> None:
    host = Host()
    host.write(1, 9, *word(1000), *word(3000))
    host.write(1, GOAL, *word(goal))
    assert host.wait(3.0).read(1, PRESENT) == reached
    assert bytes(word(goal)) == host.servo.read(GOAL, 2)


def test_within_one_turn_the_seam_is_not_crossed() -> None:
    host = Host(position=4095)
    host.write(1, GOAL, *word(0))
    assert host.wait(0.6).read(1, PRESENT) in range(1900, 2300)  # the long way
    assert host.wait(2.0).read(1, PRESENT) == 0


def test_limits_0_and_phase_bit_4_count_over_many_turns() -> None:
    host = Host(position=100)
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, PHASE, 12 + 16)
    host.write(1, GOAL, *word(10_000))
    assert host.wait(10.0).read(1, PRESENT) == 10_000
    host.write(1, GOAL, *word(-5_000))
    assert host.wait(10.0).read(1, PRESENT) == 5_000 | 0x8000
    host.servo.power_cycle()  # the turn count is lost
    assert host.read(1, PRESENT) == (-5_000) % 4096


@pytest.mark.parametrize(("time", "seconds"), [(1000, 1.0), (2000, 2.0)])
def test_scs_moves_in_the_time_of_register_44(time: int, seconds: float) -> None:
    host = Host((1,), "scs")
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *big(900), *big(time), 0, 0)
    assert host.wait(seconds - 0.01).read(1, MOVING, 1) == 1
    assert (host.wait(0.02).read(1, MOVING, 1), host.read(1, PRESENT, order="big")) == (0, 900)


def test_hls_with_goal_torque_0_stays_and_tells_that_its_goal_is_not_reached() -> None:
    host = Host((1,), "hls", position=1000)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(2000), 0, 0, *word(60))
    assert (host.wait(2.0).read(1, PRESENT), host.read(1, MOVING, 1)) == (1000, 2)
    host.write(1, DUTY, *word(500))
    assert host.read(1, MOVING, 1) == 3
    assert (host.wait(2.0).read(1, PRESENT), host.read(1, MOVING, 1)) == (2000, 0)


# -- other modes -----------------------------------------------------------------------------------


def test_velocity_mode_turns_and_stops() -> None:
    host = Host(position=0)
    host.write(1, MODE, 1)
    host.write(1, VELOCITY, *word(-1000))
    assert host.wait(1.0).read(1, PRESENT) == 0  # limp
    host.write(1, GOAL, 0, 4)  # switches torque on in position and step mode only
    assert host.read(1, TORQUE, 1) == 0
    host.write(1, TORQUE, 1)
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 1000 | 0x8000
    assert host.read(1, MOVING, 1) == 1
    assert 3096 <= host.read(1, PRESENT) < 3200  # almost -1000, within one turn
    host.write(1, VELOCITY, *word(0))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 0
    assert host.read(1, MOVING, 1) == 0


def test_unknown_mode_rests() -> None:
    host = Host((1,), "hls")
    host.write(1, TORQUE, 1)
    host.write(1, MODE, 4)
    host.write(1, GOAL, *word(100), *word(500), *word(60))
    assert host.wait(2.0).read(1, PRESENT) == 2048


def test_positive_duty_of_sts_turns_to_smaller_angles_and_scs_with_both_limits_0_is_a_motor() -> None:
    host = Host((1,), "scs")
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, TORQUE, 1)
    host.write(1, DUTY, *big(500, sign_bit=10))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY, order="big") == 1024
    host = Host()
    host.write(1, MODE, 2)
    host.write(1, TORQUE, 1)
    host.write(1, DUTY, *word(500, sign_bit=10))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 1700 | 0x8000
    host.write(1, DUTY, *word(-250, sign_bit=10))
    assert host.wait(1.0).read(1, PRESENT_VELOCITY) == 850


def test_each_write_of_the_goal_is_a_step_from_the_last_goal() -> None:
    host = Host(position=1000)
    host.write(1, MODE, 3)
    host.write(1, GOAL, *word(1000), 0, 0, *word(1000))
    host.wait(0.5).write(1, GOAL, *word(1000))  # on the way
    host.write(1, VELOCITY, *word(500))  # no step
    assert host.wait(9.0).read(1, PRESENT) == 3000
    host.write(1, TORQUE, 0)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(-300))
    assert host.wait(5.0).read(1, PRESENT) == 2700


@pytest.mark.parametrize(("load", "velocity"), [(0.0, 68), (0.1, 68), (0.2, 0)])
def test_current_mode_of_hls_turns_unless_the_load_is_as_strong(load: float, velocity: int) -> None:
    host = Host((1,), "hls")
    host.write(1, MODE, 2)
    host.write(1, TORQUE, 1)
    host.write(1, DUTY, *word(100))  # 0.65 A of 3.25 A
    host.servo.load_shaft(load)
    assert host.wait(2.0).read(1, PRESENT_VELOCITY) == velocity  # in 50 counts/s


# -- feedback --------------------------------------------------------------------------------------


def test_feedback_at_rest_and_under_load() -> None:
    # position 2048, velocity 0, load 0, 7.4 V, 30 °C, none pending, no alarm, at rest, goal 0, current 0
    found = Host().say(packet(1, READ, 56, 15))
    assert found == ["FF FF 01 11 00 00 08 00 00 00 00 4A 1E 00 00 00 00 00 00 00 7D"]
    host = Host(goal_at_power_up="present")
    host.servo.load_shaft(-0.2)
    assert (host.read(1, LOAD), host.read(1, CURRENT)) == (0, 0)  # limp
    host.write(1, TORQUE, 1)
    assert (host.read(1, LOAD), host.read(1, CURRENT)) == (200 | 0x400, 100 | 0x8000)  # of 3.25 A
    host.write(1, PHASE, 12 + 32)  # no current feedback
    assert (host.read(1, LOAD), host.read(1, CURRENT)) == (200 | 0x400, 0)


@pytest.mark.parametrize(("start", "goal", "sign", "load_sign"), [(0, 4000, 0, 0), (4000, 0, 0x8000, 0x400)])
def test_feedback_on_the_way(start: int, goal: int, sign: int, load_sign: int) -> None:
    host = Host(position=start)
    host.write(1, GOAL, *word(goal), 0, 0, *word(1700))
    host.wait(1.0)
    assert host.read(1, PRESENT_VELOCITY) == 1700 | sign
    assert host.read(1, LOAD) == 500 | load_sign  # half of the top speed
    assert (host.read(1, MOVING, 1), host.read(1, 67)) == (1, goal)
    assert host.read(1, CURRENT) == 23 | sign  # 150 mA in 6.5 mA


# -- calibration -----------------------------------------------------------------------------------


def test_offset_counts_in_position_mode_only_and_wraps() -> None:
    host = Host(position=2048)
    host.write(1, OFFSET, *word(85, sign_bit=11))
    assert host.read(1, PRESENT) == 1963
    host.write(1, MODE, 1)
    assert host.read(1, PRESENT) == 2048
    host.write(1, MODE, 0)
    host.write(1, OFFSET, *word(-2047, sign_bit=11))
    assert host.read(1, PRESENT) == 4095
    host.write(1, GOAL, *word(3000))
    assert host.wait(3.0).read(1, PRESENT) == 3000
    host = Host(position=100)
    host.write(1, PHASE, 12 + 16)  # positions over many turns
    host.write(1, OFFSET, *word(500, sign_bit=11))
    assert host.read(1, PRESENT) == 100 - 500 + 4096


def test_offset_of_scs2_ends_where_both_limits_0_make_a_motor_of_it() -> None:
    host = Host((1,), "scs2", position=300)
    row = host.servo.model.table["homing_offset"]
    host.write(1, row.address, *row.encode(100))
    assert host.servo.raw_position == 200
    host.write(1, 9, 0, 0, 0, 0)
    assert host.servo.raw_position == 300


def test_128_makes_the_present_pose_the_middle() -> None:
    host = Host(position=3000)
    assert host.write(1, TORQUE, 128) == ACK
    assert (host.read(1, PRESENT), host.read(1, OFFSET), host.read(1, TORQUE, 1)) == (2048, 952, 0)
    host.write(1, GOAL, *word(1000))
    host.wait(3.0).write(1, TORQUE, 128)  # the old offset is taken out first
    assert host.read(1, OFFSET) == 96 | 0x800  # the encoder is at 1952
    assert (host.read(1, PRESENT), host.read(1, TORQUE, 1)) == (2048, 1)
    assert host.wait(3.0).read(1, PRESENT) == 2048
    host = Host(position=0)  # the pose that needs 2048 is one count beside
    host.write(1, TORQUE, 128)
    assert (host.read(1, OFFSET), host.read(1, PRESENT)) == (2047 | 0x800, 2047)


@pytest.mark.parametrize("name", MODELS)
def test_0x0b_sets_the_position_of_sts_and_hls(name: str) -> None:
    host = Host((1,), name, position=300)
    known = name in ("sts", "hls")
    assert host.say("FF FF 01 04 0B 00 04 EB") == (ACK if known else [])
    assert host.servo.raw_position == (1024 if known else 300)
    assert host.say(packet(1, CALIBRATE)) == (ACK if known else [])
    assert host.servo.raw_position == (2048 if known else 300)


@pytest.mark.parametrize(("lock", "kept"), [(1, 0), (0, 952)])
def test_offset_of_a_calibration_outlasts_power_off_with_the_lock_open(lock: int, kept: int) -> None:
    host = Host(position=3000)
    host.write(1, LOCK, lock)
    host.write(1, TORQUE, 128)
    host.wait(0.1).servo.power_cycle()
    assert host.read(1, OFFSET) == kept


@pytest.mark.parametrize("model", ["hls3925", "sts3045bl"])
def test_0x0a_clears_the_turns_of_hls_and_brushless_models(model: str) -> None:
    host = Host((1,), model, position=100)
    host.write(1, PHASE, 12 + 16)
    host.servo.raw_position = 9000
    assert host.say(packet(1, CLEAR_TURNS)) == ACK
    assert host.read(1, PRESENT) == 9000 - 2 * 4096


# -- supply, alarms, REG WRITE ---------------------------------------------------------------------


@pytest.mark.parametrize("cut", ["power_cycle", "unplug"])
def test_loss_of_supply_resets_ram_and_leaves_the_shaft(cut: str) -> None:
    host = moving_host()
    host.write(1, ACCELERATION, 9)
    host.say(packet(1, REG_WRITE, GOAL, *word(1500)))
    there, servo = host.servo.raw_position, host.servo
    servo.alarm = 0x10
    getattr(servo, cut)()
    servo.voltage = 7.0
    assert host.wait(5.0).servo.raw_position == there
    servo.plug()
    assert [host.read(1, address, 1) for address in (TORQUE, ACCELERATION, LOCK, 64, 65)] == [0, 0, 1, 0, 0]
    assert (host.read(1, GOAL), host.read(1, VELOCITY), host.read(1, LIMIT)) == (0, 0, 1000)
    host.write(1, ACCELERATION, 3)
    servo.plug()  # it is plugged
    assert host.read(1, ACCELERATION, 1) == 3


def test_options_of_power_up() -> None:
    assert Host(lock_at_power_up="no").read(1, LOCK, 1) == 0
    host = Host(startup_time=0.05)
    assert host.read(1, 5, 1) == 1  # it has been on for long
    host.servo.power_cycle()
    assert host.write(1, ACCELERATION, 1) == []
    assert host.wait(0.06).read(1, 5, 1) == 1


@pytest.mark.parametrize("name", MODELS)
def test_supply_and_heat_raise_alarms_in_every_packet(name: str) -> None:
    host = Host((1,), name)
    host.servo.voltage, host.servo.temperature = 1.0, 101.0
    assert host.write(1, 13, 50) == ["FF FF 01 02 05 F7"]
    assert (host.read(1, 65, 1), host.read(1, 62, 1), host.read(1, 63, 1)) == (5, 10, 101)
    assert host.servo.status()["alarm"] == ["voltage", "temperature"] == list(alarms(5, name))


@pytest.mark.parametrize(("bits", "limp"), [(0x20, True), (0x04, True), (0x10, False)])
def test_alarm_of_the_unload_mask_makes_it_limp_until_it_ends(bits: int, limp: bool) -> None:
    host = moving_host()
    there = host.servo.raw_position
    host.servo.alarm = bits
    assert host.wait(3.0).read(1, PRESENT) == (there if limp else 3000)
    host.servo.alarm = 0
    assert host.wait(3.0).read(1, PRESENT) == 3000


def test_status_as_plain_data() -> None:
    host = moving_host()
    host.servo.alarm = 0x11
    assert host.servo.status() == {
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
