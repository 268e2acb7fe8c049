"""Caps: how hard a servo may push, by the register that its map has for that, and never by EEPROM."""

from __future__ import annotations

from math import nan

import pytest

from motorbus.core.entry import Storage
from motorbus.errors import DeviceError, RequestError
from motorbus.families.feetech.driver import cap_current, cap_torque
from motorbus.families.feetech.table import CONTROL
from tests.families.feetech.driver_script import play
from tests.families.feetech.maps import MODELS, met, prepares_as, simulated

CAPPED = [name for name in MODELS if CONTROL[name].limit]
OTHERS = [name for name in MODELS if not CONTROL[name].limit]


@pytest.mark.parametrize("name", CAPPED)
def test_a_cap_of_the_torque_is_in_ram_and_gone_with_the_supply(name: str) -> None:
    with simulated(name) as (device, servo):
        kept = device.memory["max_torque"]
        servo.bus.run(cap_torque(servo, 0.25))
        assert servo.torque_limit() == pytest.approx(0.25)
        assert servo.table["torque_limit"].storage is Storage.RAM
        assert device.memory["max_torque"] == kept
        device.power_cycle()
        assert device.memory["torque_limit"] == kept


@pytest.mark.parametrize("name", OTHERS)
def test_where_eeprom_alone_bounds_the_torque_nothing_is_written(name: str) -> None:
    with pytest.raises(RequestError, match=r"in EEPROM \(max_torque\)"):
        play(cap_torque(met(name), 0.5))


@pytest.mark.parametrize("fraction", [-0.1, 1.1, nan, True])
def test_what_is_no_fraction_is_refused(fraction: float) -> None:
    with pytest.raises(RequestError, match="is no torque limit"):
        play(cap_torque(met("sts"), fraction))


def test_an_unknown_map_is_never_capped() -> None:
    with pytest.raises(DeviceError, match="register map"):
        play(cap_torque(met("sts", at_0=20), 0.5))


def test_a_cap_of_the_current_goes_along_with_every_later_order() -> None:
    with simulated("hls") as (device, servo):
        servo.bus.run(cap_current(servo, 0.5))
        bound = device.memory["goal_torque"]
        assert servo.value(servo.table["goal_torque"], bound) == pytest.approx(0.5, abs=0.01)
        servo.enable_torque()
        servo.move(servo.position() + 0.1)
        assert device.memory["goal_torque"] == bound
        device.power_cycle()
        assert device.memory["goal_torque"] != bound


@pytest.mark.parametrize("ampere", [0.0, -1.0, 1e9])
def test_what_would_leave_it_without_force_is_no_bound(ampere: float) -> None:
    with pytest.raises(RequestError, match="is no bound of its current"):
        play(cap_current(met("hls"), ampere), prepares_as("hls"))


@pytest.mark.parametrize("name", [name for name in MODELS if not CONTROL[name].current])
def test_who_has_no_such_register_is_refused(name: str) -> None:
    with pytest.raises(RequestError, match="no register that bounds its current"):
        play(cap_current(met(name), 0.5), prepares_as(name))


def test_where_the_register_is_the_goal_it_is_no_bound() -> None:
    with pytest.raises(RequestError, match="operating mode current"):
        play(cap_current(met("hls"), 0.5), prepares_as("hls", at_33=2))
