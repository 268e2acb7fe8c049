"""An alarm with the figures that raised it: the supply and its limits, the temperature and its limit."""

from __future__ import annotations

import pytest

from motorbus.core.family import State
from motorbus.families.feetech.driver import Node, alarms
from motorbus.families.feetech.driver.alarm import Bounds, in_words
from motorbus.families.feetech.table import ALARM_BITS, TABLES
from tests.families.feetech.driver_script import play, prepares, reads
from tests.families.feetech.maps import met, prepares_as, simulated

BOUNDS = Bounds(70.0, 8.0, 4.0)


def feedback(voltage: int, temperature: int, error: int) -> tuple[int, ...]:
    """Registers 56 to 70 of a servo at rest."""
    return (0, 8, 0, 0, 0, 0, voltage, temperature, 0, error, 0, 0, 0, 0, 0)


def words(name: str, voltage: float = 7.4, temperature: float = 30.0) -> str:
    (said,) = in_words(State(0.0, voltage=voltage, temperature=temperature, alarm=(name,)), BOUNDS)
    return said


def test_a_supply_above_the_limit() -> None:
    """A 7.4 V servo on 12 V: an alarm in every packet, which looks like trouble with the line (lerobot#1010)."""
    found = play(
        alarms(met("sts")), reads(3, 56, *feedback(121, 30, 1), error=1), reads(3, 13, 70, 80, 40, error=1)
    )
    assert found == ("voltage: supply 12.1 V above limit 8.0 V: is the servo meant for this supply?",)


def test_without_an_alarm_the_limits_are_not_asked() -> None:
    assert play(alarms(met("sts")), reads(3, 56, *feedback(74, 30, 0))) == ()


def test_a_servo_that_nobody_knows_yet_is_asked_what_it_is() -> None:
    assert play(alarms(Node(3)), prepares_as("hls"), reads(3, 56, *feedback(74, 30, 0))) == ()


def test_one_with_unknown_firmware_has_the_registers_that_all_maps_share() -> None:
    found = play(
        alarms(Node(3)),
        *(prepares(at_0=9), reads(3, 56, *feedback(121, 30, 1), error=1), reads(3, 13, 70, 80, 40, error=1)),
    )
    assert "supply 12.1 V above limit 8.0 V" in found[0]


@pytest.mark.parametrize(
    ("voltage", "said"),
    [
        (12.1, "supply 12.1 V above limit 8.0 V"),
        (3.9, "supply 3.9 V below limit 4.0 V"),
        (7.4, "supply 7.4 V within 4.0 to 8.0 V now: it may dip under load"),
        (0.0, "it measures 0.0 V: known of servos that were given the phase register of another one"),
    ],
)
def test_the_supply_in_words(voltage: float, said: str) -> None:
    assert said in words("voltage", voltage=voltage)


def test_the_temperature_in_words() -> None:
    assert words("temperature", temperature=71) == "temperature: 71 °C inside, above its limit of 70 °C"
    assert "within its limit of 70 °C" in words("temperature", temperature=60)


def test_every_bit_has_words() -> None:
    for name in ALARM_BITS.values():
        assert words(name).startswith(f"{name}: ")
        assert ("no source says" in words(name)) == name.startswith("undefined")
    assert "recover_overload()" in words("overload")


@pytest.mark.parametrize("name", TABLES)
def test_a_simulated_servo_of_every_map_on_a_wrong_supply(name: str) -> None:
    with simulated(name) as (real, servo):
        assert servo.alarms() == ()
        real.voltage = real.memory["max_voltage"] / 10 + 1
        (said,) = servo.alarms()
        assert f"above limit {real.memory['max_voltage'] / 10:.1f} V" in said
