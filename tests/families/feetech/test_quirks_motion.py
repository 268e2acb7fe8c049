"""Quirks of moving: a flag that says little, goals nobody meant, offsets, modes and what an overload leaves behind.

Each test is named after its number in docs/reference/feetech-quirks.md, and says what real servos were seen to do and
who saw it.
"""

from __future__ import annotations

import pytest

import motorbus
from motorbus.errors import DeviceError, MotorbusError, NoReply, RequestError, Stalled
from motorbus.families.feetech import sync_read
from motorbus.families.feetech.table import CONTROL, TABLES, Mode
from motorbus.link.base import PerfectLine
from tests.families.feetech.maps import MODELS
from tests.families.feetech.quirk_bus import Lossy, bench, writes_to

COUNT = 2 * 3.141592653589793 / 4096
TORQUE, GOAL = 40, 42


@pytest.mark.parametrize("encoder", [0, 1, 2, 2046, 2047, 2048, 2049, 4094, 4095])
def test_quirk_10_a_homing_offset_never_overflows(encoder: int) -> None:
    """A calibration that does not go the shortest way around the turn asks for offsets of 2048 to 2816, which no
    register holds: the reading is wrong by half a turn, or the calibration crashes.

    huggingface/lerobot#1296, #3370, #3373, #1885, #3348; SO-ARM100#116.
    """
    for how in ("auto", "offset"):
        with bench() as there:
            simulated, servo = there.simulated(), there.servo()
            simulated.raw_position = encoder
            done = servo.calibrate(how=how)
            assert abs(done.raw_new_offset) <= 2047
            assert (
                abs(simulated.raw_position - 2048) <= 1
            )  # one pose of 4096 needs one count more than there is
            assert (simulated.raw_position == 2048) == (done.note == "")
            simulated.raw_position = 100
            assert servo.calibrate(how=how).raw_old_offset == done.raw_new_offset  # the old one is added back
            assert abs(simulated.raw_position - 2048) <= 1


def test_quirk_10_a_servo_that_counts_turns_is_not_calibrated_over_its_turn() -> None:
    """The same with bit 4 of the phase set, where the position leaves 0 to 4095: refused, and told what to do.

    huggingface/lerobot#3373 clears that bit by itself; here that is a verb of its own, and somebody's decision.
    """
    with bench() as there:
        simulated, servo = there.simulated(), there.servo()
        simulated.memory["phase"] = simulated.memory["phase"] | 1 << 4
        simulated.raw_position = 6015
        before = bytes(simulated.memory.live[:40])
        with pytest.raises(RequestError, match="6015.*not within one turn"):
            servo.calibrate()
        assert bytes(simulated.memory.live[:40]) == before
        servo.set_many_turns(False)
        assert servo.calibrate().raw_old_offset == 0


@pytest.mark.parametrize("name", [name for name, table in TABLES.items() if "homing_offset" in table])
def test_quirk_11_the_homing_offset_holds_in_every_mode(name: str) -> None:
    """The servo applies its offset in position mode only: in wheel mode the reading jumps, by 85 where it was met.

    STS_servos#9; so_arm_100_hardware#13: measured on STS servos; that those of other maps do the same is assumed.
    """
    with bench(model=MODELS[name], servo_baud=1_000_000) as there:
        simulated, servo = there.simulated(), there.servo()
        middle = CONTROL[name].turn // 2
        simulated.raw_position = middle + 85
        servo.calibrate()
        here = servo.position()
        assert simulated.raw_position == middle
        control = CONTROL[name]
        has = [mode for mode in control.modes.values() if mode is not Mode.PWM or control.duty]
        for mode in [*has, Mode.POSITION] if has else [Mode.POSITION, Mode.PWM]:
            servo.set_mode(mode)
            assert servo.position() == pytest.approx(here)
            assert servo.telemetry().position == pytest.approx(here)
            jump = 0 if mode is Mode.POSITION else 85
            assert servo.read_raw("present_position")["present_position"] == middle + jump  # raw stays raw


def test_quirk_14_an_overload_latch_is_no_obstacle_to_torque_off() -> None:
    """With an overload alarm in every packet, a library that takes alarms for failures cannot even switch off.

    humancomputerlab/lelamp_runtime#9; open-edge-platform/physical-ai-studio#955: only a power cycle cleared it.
    """
    with bench(overload_clears="power_cycle") as there:
        simulated, servo = there.simulated(), there.servo()
        servo.enable_torque()
        simulated.torque = 0.9
        there.wait(3.0)
        assert servo.telemetry().alarm == ("overload",)
        simulated.torque = 0.0
        servo.disable_torque()
        assert simulated.memory["torque_enable"] == 0
        with pytest.raises(DeviceError, match="switch its supply off and on"):
            servo.recover_overload()
        assert simulated.memory["torque_enable"] == 0  # it is left limp
        simulated.power_cycle()
        assert servo.recover_overload().tripped == ()


def test_quirk_16_a_calibration_is_proven_and_can_be_compared() -> None:
    """A calibration was in a file and not in the servo: after a restart the two disagreed.

    huggingface/lerobot#1342, #1360. Here the servo holds it, it is read back, and `zero` tells what is there.
    """
    with bench() as there:
        simulated, servo = there.simulated(), there.servo()
        simulated.raw_position = 1000
        done = servo.calibrate(to=1.0)
        assert done.after == pytest.approx(1.0, abs=COUNT)
        simulated.power_cycle()
        zero = there.servo().zero()
        assert (zero.raw_offset, zero.position) == (done.raw_new_offset, pytest.approx(1.0, abs=COUNT))
        assert zero.offset == done.new_offset
        assert zero.limits == pytest.approx((0, 4095 * COUNT))


def test_quirk_19_a_goal_is_reached_within_play_and_load_and_no_better() -> None:
    """About 1° of play; 20 to 30 counts beside the goal under 1.5 kg at 10 cm; 15 °C more in 10 minutes; overload at
    2 kg.

    SO-ARM100#134; STS_servos#5. So a move ends within 0.05 rad, and nobody is promised a tenth of a degree.
    """
    with bench(droop=50.0, backlash=11.0) as there:
        simulated, servo = there.simulated(), there.servo()
        places = []
        for start in (1.0, 5.0):
            servo.move(start)
            servo.move(3.0)
            places.append(servo.position() / COUNT)
        assert 0 < abs(places[0] - places[1]) <= 11 + 1  # the play, and a count of rounding
        simulated.torque = 0.5
        servo.move(2.0)
        beside = abs(servo.position() - 2.0) / COUNT
        assert 20 <= beside <= 36  # what the load takes, and the play
        with pytest.raises(Stalled):
            servo.move(1.0, tolerance=0.1 * 3.141592653589793 / 180)


def test_quirk_19_holding_a_load_warms_it_and_too_much_of_it_is_an_overload() -> None:
    """The same by its temperature and by its protection, with the figures of the STS3215 memory table V3.6."""
    with bench() as there:
        simulated, servo = there.simulated(), there.servo()
        servo.enable_torque()
        before = servo.temperature()
        simulated.torque = 0.5
        there.wait(600.0)
        assert servo.temperature() - before == pytest.approx(15.0, abs=5.0)
        assert servo.telemetry().alarm == ()
        simulated.torque = 0.9
        there.wait(3.0)
        assert servo.telemetry().alarm == ("overload",)


def test_quirk_25_arrival_is_a_position_and_not_a_flag() -> None:
    """The moving flag says "stopped" while the servo stands off its goal, stalled or within its dead band.

    makerforgetech/modular-biped#163.
    """
    with bench() as there:
        servo = there.servo()
        servo.write(torque_limit=0.005)  # less than its own friction
        with pytest.raises(Stalled, match="off its goal"):
            servo.move(1.0)
        assert servo.telemetry().moving is False
        with pytest.raises(Stalled):
            servo.move(1.0, tolerance=0.01, timeout=60.0)
        servo.move(1.0, wait=False)  # who does not wait is not told


def test_quirk_27_a_missing_reading_is_never_a_number() -> None:
    """A goal of 0, or of the middle, was written because the first reading had failed: the arm jumped.

    PickNikRobotics/moveit_pro_example_ws#930, #932; st3215-bus leaves silent motors out.
    """
    with bench("1-2") as there:
        servo = there.servo()
        servo.prepare()
        there.simulation.line = Lossy(lambda reply: reply[2] == 1 and len(reply) > 6)  # its readings are lost
        for verb in (servo.enable_torque, servo.stop, servo.position, servo.telemetry):
            with there.traffic() as sent, pytest.raises(MotorbusError):
                verb()
            assert writes_to(sent, GOAL) == writes_to(sent, TORQUE) == []
        there.simulation.line = PerfectLine()
        there.simulated(1).unplug()
        servos = [there.servo(id) for id in (1, 2)]
        with pytest.raises(NoReply):
            servos[0].prepare()
        result = there.bus.run(sync_read(["present_position"], [2, 1]))
        assert set(result.values) == {2}
        assert set(result.errors) == {1}


def test_quirk_27_torque_goes_on_where_the_servo_stands() -> None:
    """The same at power-up, where the goal position reads 0: what holds is the pose, whatever was in the register."""
    with bench(goal_at_power_up="zero") as there:
        there.simulated().raw_position = 3000
        assert there.simulated().memory["goal_position"] == 0
        motorbus.feetech.Servo(there.bus, 1).enable_torque()
        there.wait(2.0)
        assert there.simulated().raw_position == 3000


def test_quirk_26_what_keeps_a_servo_from_moving_is_told() -> None:
    """Velocity mode seems dead: it is another mode, a torque limit of 0, another unit of velocity.

    liyiteng/AlohaMini#6; Mickael-Roger/python-st3215#4.
    """
    with bench() as there:
        servo = there.servo()
        with pytest.raises(RequestError, match="velocity"):
            servo.set_velocity(1.0)  # it is in position mode
        servo.set_mode("velocity")
        servo.write(torque_limit=0.0)
        found = servo.blockers()
        assert any("torque" in one for one in found)
        servo.write(torque_limit=1.0)
        servo.enable_torque()
        servo.set_velocity(1.0)
        assert servo.blockers() == ()
        there.wait(1.0)
        assert servo.velocity() == pytest.approx(1.0, abs=0.01)


def test_quirk_26_the_unit_of_velocity_is_that_of_the_phase_register() -> None:
    """The same number is fifty times as fast where bit 2 of the phase is clear; rad/s are rad/s in both."""
    with bench() as there:
        simulated, servo = there.simulated(), there.servo()
        simulated.memory["phase"] = simulated.memory["phase"] & ~(1 << 2)
        servo.set_mode("velocity")
        servo.enable_torque()
        servo.set_velocity(2.0)
        assert simulated.memory["goal_velocity"] == round(2.0 / COUNT / 50)
        there.wait(1.0)
        assert servo.velocity() == pytest.approx(2.0, abs=50 * COUNT)
