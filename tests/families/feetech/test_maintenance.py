"""Factory restore, turn count, overload, and the reasons why a servo does not move."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import DeviceError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.feetech import Servo
from motorbus.families.feetech.protocol import Instruction
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS
from tests.families.feetech.worlds import RATES, later, traffic, world, writes


class TestFactoryRestore:
    @pytest.mark.parametrize("name", TABLES)
    def test_settings_are_as_shipped_and_the_servo_is_found_again(self, name: str) -> None:
        with world(name, ids="1,3") as (bus, servo, simulation):
            shipped = simulation[1].memory["max_temperature"]
            servo.write(max_temperature=50)
            servo.enable_torque()
            found = servo.factory_restore()
            assert (found.node, found.identity.table) == (1, name)
            assert bus.rate == RATES.get(name, 1_000_000)
            assert simulation[1].memory["max_temperature"] == shipped
            assert simulation[1].memory["torque_enable"] == 0

    def test_a_servo_at_another_rate_is_found_at_that_of_the_factory(self) -> None:
        with world(ids="3") as (bus, _, _):
            Servo(bus, 3).set_baud(500_000)
            bus.run(_tune(500_000))
            found = Servo(bus, 3).factory_restore()
            assert (found.node, found.rate, bus.rate) == (3, 1_000_000, 500_000)

    def test_a_servo_without_the_instruction_differs_from_a_silent_one(self) -> None:
        with world() as (_, servo, simulation):
            simulation[1].lacks = {Instruction.RESET}
            with pytest.raises(OutcomeUnknown):
                servo.factory_restore()
            link: Any = servo.bus.link
            write = link.write

            def unplug(data: bytes) -> None:
                write(data)
                if data[4] == Instruction.RESET:
                    simulation[1].unplug()

            link.write = unplug
            with pytest.raises(NoReply, match="scan all ids|does not answer"):
                servo.factory_restore()


def _tune(rate: int) -> Any:
    from motorbus.core.steps import SetBitrate

    return SetBitrate(rate)


class TestClearTurns:
    def test_an_hls_forgets_its_turns_and_is_limp(self) -> None:
        with world("hls") as (_, servo, simulation):
            servo.set_multi_turn(True)
            servo.enable_torque()
            servo.move(15.0)
            assert servo.clear_turns() == pytest.approx(15.0 % 6.2832, abs=0.06)
            assert simulation[1].memory["torque_enable"] == 0

    def test_an_sts_that_ignores_it_is_named(self) -> None:
        with world() as (_, servo, simulation):
            simulation[1].lacks = {Instruction.CLEAR_TURNS}
            servo.set_multi_turn(True)
            servo.enable_torque()
            servo.move(15.0)
            with pytest.raises(DeviceError, match="not to the order to forget"):
                servo.clear_turns()

    @pytest.mark.parametrize("name", [name for name in TABLES if not TRAITS[name].clear_turns])
    def test_maps_without_it_refuse(self, name: str) -> None:
        with world(name) as (bus, servo, _), traffic(bus) as sent:
            with pytest.raises(RequestError, match="counts no turns"):
                servo.clear_turns()
            assert writes(sent) == []


class TestOverload:
    def test_nothing_is_done_without_an_alarm(self) -> None:
        with world() as (bus, servo, _), traffic(bus) as sent:
            assert servo.recover_overload() == ((), ())
            assert writes(sent) == []

    def test_a_tripped_servo_rests_limp_and_then_holds_where_it_stands(self) -> None:
        with world() as (bus, servo, simulation):
            servo.enable_torque()
            simulation[1].alarm = 0x20
            link: Any = bus.link
            write = link.write

            def clears(data: bytes) -> None:
                write(data)
                if data[4:7] == b"\x03\x28\x00":
                    simulation[1].alarm = 0

            link.write = clears
            found = servo.recover_overload()
            assert found.tripped == ("overload",)
            assert simulation[1].memory["torque_enable"] == 1

    def test_an_alarm_that_stays_ends_limp(self) -> None:
        with world(overload_clears="power_cycle") as (_, servo, simulation):
            servo.enable_torque()
            simulation[1].alarm = 0x20
            with pytest.raises(DeviceError, match="still set"):
                servo.recover_overload()
            assert simulation[1].memory["torque_enable"] == 0


# -- diagnosis -------------------------------------------------------------------------------------------------


def test_a_servo_that_would_move_has_no_reason() -> None:
    for name in TABLES:
        with world(name) as (_, servo, _):
            servo.enable_torque()
            assert servo.why_not_moving() == ()
            assert servo.alarms() == ()


REASONS: list[tuple[str, dict[str, int], str]] = [
    ("sts", {"torque_enable": 0}, "its torque is off"),
    ("sts", {"torque_limit": 0}, "torque_limit is 0"),
    ("sts", {"max_torque": 0}, "max_torque is 0"),
    ("sts", {"min_position_limit": 3000, "max_position_limit": 2000}, "leave no range"),
    ("hls", {"goal_torque": 0}, "goal_torque is 0"),
    ("hls", {"goal_torque": 0, "protection_current": 0}, "protection current is 0 as well"),
]


@pytest.mark.parametrize(("name", "settings", "reason"), REASONS)
def test_settings_that_keep_a_servo_from_moving_are_named(
    name: str, settings: dict[str, int], reason: str
) -> None:
    with world(name) as (bus, servo, simulation):
        servo.enable_torque()
        for row, raw in settings.items():
            simulation[1].memory[row] = raw
        with traffic(bus) as sent:
            assert any(reason in one for one in servo.why_not_moving())
        assert writes(sent) == []


def test_in_velocity_mode_a_velocity_of_0_is_the_reason() -> None:
    with world() as (_, servo, _):
        servo.set_mode("velocity")
        servo.enable_torque()
        assert servo.why_not_moving() == ("its goal velocity is 0: set_velocity() gives one",)


@pytest.mark.parametrize(
    ("bit", "name", "text"),
    [
        (0, "voltage", "is the servo meant for this supply"),
        (2, "temperature", "its limit is 70"),
        (5, "overload", ""),
    ],
)
def test_alarms_come_with_the_figures_that_raised_them(bit: int, name: str, text: str) -> None:
    with world() as (bus, servo, simulation):
        servo.prepare()
        simulation[1].voltage = 12.0 if bit == 0 else 7.4
        simulation[1].alarm = 1 << bit
        later(bus, 0.1)
        found = servo.alarms()
        assert [one for one in found if one.startswith(f"{name}: ") and text in one], found
        assert name in servo.telemetry().alarm
