"""Registers by name: reading, writing, refusals, EEPROM behind its lock, REG WRITE and ACTION."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from motorbus.errors import DeviceError, LimitExceeded, MotorbusError, RequestError
from motorbus.families.feetech import action_all, disable_torque_all
from motorbus.families.feetech.driver.access import GROUPS
from motorbus.families.feetech.registers import TABLES
from tests.families.feetech.worlds import later, traffic, world, writes

LOCK = {"sts": "37", "smbl": "37", "hls": "37", "smcl": "30", "scs": "30", "scs2": "30"}


@pytest.mark.parametrize("name", TABLES)
def test_read_gives_every_readable_row_of_the_map(name: str) -> None:
    with world(name) as (_, servo, simulation):
        found = servo.read_raw()
        assert list(found) == [row.name for row in TABLES[name].values() if row.readable]
        assert all(simulation[1].memory[key] == raw for key, raw in found.items() if key != "moving")


def test_a_group_of_rows_is_read_by_its_name() -> None:
    with world() as (_, servo, _):
        assert list(servo.read("limits")) == ["min_position_limit", "max_position_limit"]
        assert servo.read("gains")["position_p"] == 32
        assert "current_p" not in servo.read("gains")  # of HLS only
    assert all(any(one in table for table in TABLES.values()) for names in GROUPS.values() for one in names)


@pytest.mark.parametrize("name", TABLES)
def test_eeprom_is_written_with_lock_open_and_torque_off_and_read_back(name: str) -> None:
    with world(name) as (bus, servo, simulation):
        servo.prepare()
        with traffic(bus) as sent:
            servo.write(max_temperature=60)
        lock = LOCK[name]
        assert writes(sent) == [
            f"01 04 03 {lock} 00",
            "01 04 03 28 00",
            "01 04 03 0d 3c",
            f"01 04 03 {lock} 01",
        ]
        assert sent[-1] == f"01 04 02 {lock} 01"
        simulation[1].power_cycle()
        later(bus, 1.0)
        assert servo.read("max_temperature") == {"max_temperature": 60}


def test_equal_values_are_not_written_unless_forced() -> None:
    with world() as (bus, servo, simulation):
        servo.write(max_temperature=60)
        with traffic(bus) as sent:
            servo.write(max_temperature=60)
        assert writes(sent) == []
        with traffic(bus) as sent:
            servo.write(max_temperature=60, force=True)
        assert "01 04 03 0d 3c" in sent
        simulation[1].memory["lock"] = 0
        servo.write(max_temperature=60)
        assert simulation[1].memory["lock"] == 1


class TestTorque:
    """What becomes of the torque of a servo whose EEPROM is written."""

    def test_it_comes_back_where_the_servo_stands(self) -> None:
        with world(position=1800) as (bus, servo, simulation):
            servo.enable_torque()
            servo.move(2.0, wait=False)
            later(bus, 0.05)
            servo.write(max_temperature=60)
            assert simulation[1].memory["torque_enable"] == 1
            later(bus, 1.0)
            assert abs(simulation[1].memory["present_position"] - simulation[1].memory["goal_position"]) < 5
            assert servo.position() > 2.1  # it was stopped on its way from 2.76

    @pytest.mark.parametrize(
        "values", [{"operating_mode": 1}, {"angular_resolution": 2}, {"homing_offset": 0.1}]
    )
    def test_it_stays_off_where_a_goal_means_something_else(self, values: dict[str, float]) -> None:
        with world(position=1800) as (_, servo, simulation):
            servo.enable_torque()
            servo.write(**values)
            assert simulation[1].memory["torque_enable"] == 0

    def test_it_stays_off_outside_new_limits(self) -> None:
        with world(position=1800) as (_, servo, simulation):
            servo.enable_torque()
            with pytest.raises(LimitExceeded, match="outside its limits") as caught:
                servo.write(min_position_limit=3.2, max_position_limit=3.5)
            assert "registers are written" in "".join(caught.value.__notes__)
            assert simulation[1].memory["torque_enable"] == 0
            assert servo.read("min_position_limit")["min_position_limit"] == pytest.approx(3.2, abs=0.01)

    def test_it_stays_off_after_a_stop_meanwhile(self) -> None:
        with world(position=1800) as (bus, servo, simulation):
            servo.enable_torque()
            link: Any = bus.link
            write = link.write

            def stop_at_the_cell(data: bytes) -> None:
                write(data)
                if data[4:7] == b"\x03\x0d\x3c":
                    bus.estop()
                    bus.reset()

            link.write = stop_at_the_cell
            with suppress(MotorbusError):
                servo.write(max_temperature=60)
            link.write = write
            later(bus, 0.5)
            assert simulation[1].memory["torque_enable"] == 0


def test_a_known_homing_offset_is_written_and_shifts_the_position() -> None:
    with world(position=1800) as (_, servo, simulation):
        row = TABLES["sts"]["homing_offset"]
        servo.write(homing_offset=row.to_value(100))
        assert simulation[1].memory["homing_offset"] == 100
        assert servo.read_raw("present_position") == {"present_position": 1700}


REFUSED = [
    ("sts", {"id": 7}),
    ("sts", {"baud_rate": 0}),
    ("sts", {"phase": 12}),
    ("sts", {"present_position": 1.0}),
    ("sts", {"firmware_major": 3}),
    ("sts", {"nonsense": 1}),
    ("sts", {"lock": 0}),
    ("sts", {"torque_enable": 1}),
    ("sts", {"torque_enable": 128}),
    ("sts", {"max_temperature": 101}),
    ("sts", {"max_temperature": float("nan")}),
    ("sts", {"max_temperature": "60"}),
    ("sts", {"goal_torque": 1.0}),
    ("sts", {"goal_position": 2.0, "max_position_limit": 3.0}),
    ("hls", {"goal_torque": 0}),
    ("hls", {"control_loop": 1, "goal_position": 2.0}),
    ("scs", {"acceleration": 1.0}),
]


@pytest.mark.parametrize(("name", "values"), REFUSED, ids=lambda value: str(value))
def test_what_must_not_be_written_by_name_is_refused_and_nothing_sent(
    name: str, values: dict[str, Any]
) -> None:
    with world(name) as (bus, servo, _):
        servo.prepare()
        with traffic(bus) as sent, pytest.raises(RequestError):
            servo.write(**values)
        assert sent == []


def test_goals_are_refused_in_other_modes_and_outside_the_limits() -> None:
    with world() as (bus, servo, _):
        servo.write(min_position_limit=1.0, max_position_limit=3.0)
        with traffic(bus) as sent, pytest.raises(LimitExceeded):
            servo.write(goal_position=3.2)
        assert writes(sent) == []
        servo.set_mode("velocity")
        with pytest.raises(RequestError, match="operating mode velocity"):
            servo.write(goal_position=2.0)


def test_a_row_that_moves_a_servo_and_is_no_goal_is_written_limp() -> None:
    with world("hls") as (bus, servo, simulation):
        servo.enable_torque()
        with traffic(bus) as sent:
            servo.write(control_loop=1)
        assert writes(sent) == ["01 04 03 28 00", "01 04 03 35 01"]
        assert simulation[1].memory["torque_enable"] == 0


def test_a_servo_of_an_unknown_map_is_read_and_never_written() -> None:
    with world(firmware="9.99") as (bus, servo, _):
        assert servo.read("present_voltage") == {"present_voltage": pytest.approx(7.4)}
        with traffic(bus) as sent:
            for refused in (
                lambda: servo.write(goal_velocity=1.0),
                lambda: servo.move(1.0),
                servo.enable_torque,
                lambda: servo.set_id(7),
                lambda: servo.reg_write(goal_position=1.0),
            ):
                with pytest.raises(DeviceError, match="register map is unknown"):
                    refused()
            assert writes(sent) == []
        servo.disable_torque()
        assert bus.driver.axis(servo.identify()).names == frozenset()


# -- REG WRITE and ACTION --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TABLES)
def test_reg_write_waits_for_action(name: str) -> None:
    with world(name) as (bus, servo, _):
        servo.enable_torque()
        goal = servo.position() + 0.3
        servo.reg_write(goal_position=goal)
        later(bus, 0.5)
        assert servo.read_raw("reg_write_pending") == {"reg_write_pending": 1}
        assert servo.position() == pytest.approx(goal - 0.3, abs=0.01)
        servo.action()
        later(bus, 2.0)
        assert servo.position() == pytest.approx(goal, abs=0.02)


BETWEEN: dict[str, Callable[[Any, Any], Any]] = {
    "stop": lambda bus, servo: servo.stop(),
    "torque off": lambda bus, servo: servo.disable_torque(),
    "torque off for all": lambda bus, servo: bus.run(disable_torque_all([1])),
    "emergency stop": lambda bus, servo: (bus.estop(), bus.reset()),
    "other settings": lambda bus, servo: servo.write(max_position_limit=4.0),
    "another mode": lambda bus, servo: servo.set_mode("velocity"),
}


@pytest.mark.parametrize("what", BETWEEN)
def test_action_is_refused_after(what: str) -> None:
    with world(position=1800) as (bus, servo, simulation):
        servo.enable_torque()
        servo.reg_write(goal_position=2.5)
        BETWEEN[what](bus, servo)
        for act in (servo.action, lambda: bus.run(action_all([servo]))):
            with pytest.raises(RequestError):
                act()
        later(bus, 1.0)
        assert simulation[1].memory["present_position"] == pytest.approx(1800, abs=3)


def test_a_new_reg_write_after_a_stop_is_carried_out() -> None:
    with world(position=1800) as (bus, servo, _):
        servo.enable_torque()
        servo.reg_write(goal_position=2.5)
        servo.stop()
        servo.reg_write(goal_position=2.6)
        servo.action()
        later(bus, 1.0)
        assert servo.position() == pytest.approx(2.6, abs=0.02)
