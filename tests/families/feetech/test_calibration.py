"""Another position for the same pose, and counting over many turns."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from motorbus.errors import DeviceError, MotorbusError, RequestError, VerificationFailed
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS
from tests.families.feetech.worlds import later, traffic, world, writes

COUNT = 6.283185307179586 / 4096
CALIBRATED = [name for name in TABLES if TRAITS[name].calibrates]
TURNING = [name for name in TABLES if TRAITS[name].many_turns]


@pytest.mark.parametrize("name", [name for name in CALIBRATED if name != "scs2"])
@pytest.mark.parametrize("to", [None, 1.0, 0.0, 4095 * COUNT])
def test_the_pose_reads_what_was_asked_for_also_after_a_power_cycle(name: str, to: float | None) -> None:
    with world(name, position=1800) as (bus, servo, simulation):
        servo.enable_torque()
        found = servo.calibrate(to)
        wanted = 2048 * COUNT if to is None else to
        assert found.after == pytest.approx(wanted, abs=COUNT)
        assert servo.position() == pytest.approx(wanted, abs=COUNT)
        assert found.raw_new_offset == simulation[1].memory["homing_offset"]
        assert simulation[1].memory["torque_enable"] == 0
        simulation[1].power_cycle()
        later(bus, 1.0)
        assert servo.position() == pytest.approx(wanted, abs=COUNT)


def test_an_scs2_is_calibrated_within_its_offset_of_127_counts() -> None:
    with world("scs2", position=512) as (_, servo, _):
        wanted = servo.position() + 0.2
        assert servo.calibrate(wanted).after == pytest.approx(wanted, abs=0.006)
        with pytest.raises(RequestError, match="homing offset"):
            servo.calibrate(1.0)


@pytest.mark.parametrize("name", ["sts", "hls"])
def test_a_second_calibration_adds_the_old_offset_back(name: str) -> None:
    with world(name, position=1800) as (_, servo, _):
        for to in (1.0, 5.0, 3.0, 6.0):
            found = servo.calibrate(to)
            assert servo.position() == pytest.approx(to, abs=COUNT)
        assert found.old_offset == pytest.approx(found.raw_old_offset * COUNT)
        assert servo.zero().raw_offset == found.raw_new_offset


def test_the_requests_of_a_calibration() -> None:
    with world(position=1800) as (bus, servo, _):
        servo.prepare()
        with traffic(bus) as sent:
            servo.calibrate(1.0)
        assert writes(sent) == [
            "01 04 03 37 00",
            "01 04 03 28 00",
            "01 05 03 1f 7c 04",  # 1800 - 652 = 1148
            "01 04 03 37 01",
        ]


def test_an_hls_gets_the_instruction() -> None:
    with world("hls", position=1800) as (bus, servo, _):
        servo.prepare()
        with traffic(bus) as sent:
            servo.calibrate(1.0)
        assert "01 04 0b 8c 02" in sent


@pytest.mark.parametrize("to", [-0.1, 6.3, nan, "1"])
def test_an_impossible_angle_changes_nothing(to: Any) -> None:
    with world() as (bus, servo, _), traffic(bus) as sent:
        with pytest.raises(RequestError):
            servo.calibrate(to)
        assert writes(sent) == []


def test_it_is_refused_without_an_offset_in_other_modes_and_with_counted_turns() -> None:
    with world("scs") as (_, servo, _), pytest.raises(RequestError, match="no homing offset"):
        servo.calibrate()
    with world() as (_, servo, _):
        servo.set_mode("velocity")
        with pytest.raises(RequestError):
            servo.calibrate()
        servo.set_mode("position")
        servo.write(angular_resolution=2)
        with pytest.raises(RequestError, match="resolution"):
            servo.calibrate()
        servo.write(angular_resolution=1)
        servo.set_multi_turn(True)
        servo.enable_torque()
        servo.move(9.0)
        with pytest.raises(RequestError, match="counts turns"):
            servo.calibrate()


def test_a_shaft_that_is_turned_meanwhile_is_noticed_and_the_offset_put_back() -> None:
    with world(position=1800) as (bus, servo, simulation):
        link: Any = bus.link
        write = link.write

        def turn(data: bytes) -> None:
            write(data)
            link.advance(0.0)
            if data[4:6] == b"\x03\x1f" and data[6:8] != b"\0\0":
                simulation[1].raw_position = 2500

        link.write = turn
        with pytest.raises((VerificationFailed, DeviceError)):
            servo.calibrate(1.0)
        link.write = write
        assert simulation[1].memory["homing_offset"] == 0
        assert simulation[1].memory["lock"] == 1


@pytest.mark.parametrize("name", TURNING)
def test_many_turns_are_one_setting_of_limits_and_phase(name: str) -> None:
    with world(name) as (bus, servo, simulation):
        memory = simulation[1].memory
        phase, before = memory["phase"], servo.read("limits")
        servo.set_multi_turn(True)
        assert (memory["phase"], memory["max_position_limit"]) == (phase | 16, 0)
        servo.enable_torque()
        servo.move(15.0)
        assert servo.position() == pytest.approx(15.0, abs=0.06)
        simulation[1].power_cycle()  # forgets its turns
        later(bus, 1.0)
        with pytest.raises(RequestError, match="needs limits"):
            servo.set_multi_turn(False)
        servo.set_multi_turn(False, tuple(before.values()))
        assert memory["phase"] == phase
        assert servo.read("limits") == pytest.approx(before)


@pytest.mark.parametrize("name", [name for name in TABLES if name not in TURNING])
def test_maps_of_one_turn_refuse_many(name: str) -> None:
    with world(name) as (bus, servo, _), traffic(bus) as sent:
        with pytest.raises(RequestError, match="within one turn"):
            servo.set_multi_turn(True)
        assert writes(sent) == []


@pytest.mark.parametrize("limits", [(2.0, 1.0), (-1.0, 1.0), (0.0, 99.0)])
def test_impossible_limits_change_nothing(limits: tuple[float, float]) -> None:
    with world() as (bus, servo, _), traffic(bus) as sent:
        with pytest.raises(RequestError):
            servo.set_multi_turn(False, limits)
        with pytest.raises(MotorbusError):
            servo.set_multi_turn(True, limits)
        assert writes(sent) == []
