"""Torque, stop and move: no jump, nothing forgotten, caps."""

from __future__ import annotations

import asyncio
from math import inf, nan
from typing import Any

import pytest

import motorbus
from motorbus.errors import LimitExceeded, MotionError, RequestError, Stalled
from motorbus.families.feetech import AsyncServo, Promise, Servo
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS, Mode
from tests.families.feetech.worlds import MODES, later, put_mode, traffic, world, writes

HELD = {
    Mode.POSITION: Promise.HOLD_ACCEPTED,
    Mode.VELOCITY: Promise.ZERO_VELOCITY_ACCEPTED,
    Mode.PWM: Promise.ZERO_DUTY_ACCEPTED,
    Mode.CURRENT: Promise.ZERO_CURRENT_ACCEPTED,
}
LEFT = {"goal_position": 900, "goal_velocity": 600, "goal_time": 500, "goal_torque": 300}
"""What another program may have left in the registers of a limp servo."""


def shaft(simulation: Any, bus: Any) -> float:
    return float(simulation[1].motion.position(bus.link.now()))


@pytest.mark.parametrize("name", TABLES)
def test_it_moves_holds_and_stops(name: str) -> None:
    with world(name) as (bus, servo, simulation):
        here = servo.position()
        servo.move(here + 0.5)
        assert servo.position() == pytest.approx(here + 0.5, abs=0.06)
        servo.move(here - 0.5, velocity=1.0, wait=False)
        later(bus, 0.3)
        assert servo.stop() is Promise.HOLD_ACCEPTED
        later(bus, 0.5)
        stood = servo.position()
        assert here - 0.45 < stood < here + 0.45
        later(bus, 1.0)
        assert servo.position() == pytest.approx(stood, abs=0.02)
        servo.disable_torque()
        assert simulation[1].memory["torque_enable"] == 0


def test_a_move_is_one_packet_while_the_settings_are_known() -> None:
    with world() as (bus, servo, _):
        servo.enable_torque()
        with traffic(bus) as sent:
            servo.move(2.5, velocity=1.0, acceleration=5.0, wait=False)
        assert sent == ["01 0a 03 29 21 5e 06 00 00 8c 02"]
        later(bus, 2.0)  # another servo may have its id by now
        with traffic(bus) as sent:
            servo.move(2.6, wait=False)
        assert sent[0] == "01 04 02 00 28"


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_torque_comes_on_at_rest_whatever_the_registers_hold(name: str, mode: Mode) -> None:
    with world(name) as (bus, servo, simulation):
        put_mode(servo, mode)
        stood = shaft(simulation, bus)
        for row, raw in LEFT.items():
            if row in TABLES[name]:
                simulation[1].memory[row] = raw
        Servo(bus, 1).enable_torque()
        later(bus, 2.0)
        assert shaft(simulation, bus) == pytest.approx(stood, abs=2)
        assert simulation[1].memory["torque_enable"] == 1


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_stop_promises_what_the_mode_can_do(name: str, mode: Mode) -> None:
    with world(name) as (_, servo, _):
        put_mode(servo, mode)
        servo.enable_torque()
        if mode is Mode.STEP:
            with pytest.raises(RequestError, match="step mode"):
                servo.stop()
        else:
            assert servo.stop() is HELD[mode]


def test_stop_reads_the_settings_first() -> None:
    with world() as (bus, servo, _):
        servo.enable_torque()
        Servo(bus, 1).set_mode("velocity")  # as another program would
        assert servo.stop() is Promise.ZERO_VELOCITY_ACCEPTED


class TestOutsideItsLimits:
    """A servo that was turned beyond its limits by hand."""

    def test_torque_is_refused(self) -> None:
        with world(position=1800) as (bus, servo, _simulation):
            servo.write(min_position_limit=3.0, max_position_limit=3.5)
            with traffic(bus) as sent, pytest.raises(LimitExceeded, match="it would jump"):
                servo.enable_torque()
            assert writes(sent) == []

    def test_a_limp_one_is_left_alone_by_stop_and_one_with_torque_is_held(self) -> None:
        with world(position=1800) as (bus, servo, simulation):
            servo.write(min_position_limit=3.0, max_position_limit=3.5)
            with traffic(bus) as sent:
                assert servo.stop() is Promise.LIMP
            assert writes(sent) == []
            simulation[1].memory["torque_enable"] = 1
            assert servo.stop() is Promise.OUTSIDE_ACCEPTED


REFUSED: list[tuple[str, tuple[float, ...], dict[str, Any], type[Exception]]] = [
    ("sts", (nan,), {}, LimitExceeded),
    ("sts", (inf,), {}, LimitExceeded),
    ("sts", (7.0,), {}, LimitExceeded),
    ("sts", (99.0,), {}, LimitExceeded),
    ("sts", (2.5,), {"velocity": 0.0}, RequestError),
    ("sts", (2.5,), {"velocity": -1.0}, RequestError),
    ("sts", (2.5,), {"velocity": 1e9}, RequestError),
    ("sts", (2.5,), {"acceleration": -1.0}, RequestError),
    ("sts", (2.5,), {"current": 0.5}, RequestError),
    ("sts", (2.5,), {"tolerance": 0.0}, RequestError),
    ("sts", (2.5,), {"timeout": nan}, RequestError),
    ("scs", (2.5,), {"acceleration": 5.0}, RequestError),
    ("hls", (2.5,), {"current": 0.0}, RequestError),
    ("hls", (2.5,), {"current": 99.0}, RequestError),
]


@pytest.mark.parametrize(("name", "to", "bounds", "error"), REFUSED)
def test_an_impossible_move_is_refused_and_nothing_written(
    name: str, to: tuple[float, ...], bounds: dict[str, Any], error: type[Exception]
) -> None:
    with world(name) as (bus, servo, _):
        servo.enable_torque()
        with traffic(bus) as sent, pytest.raises(error):
            servo.move(*to, **bounds)
        assert writes(sent) == []


def test_a_move_in_another_mode_names_the_mode_it_needs() -> None:
    with world() as (bus, servo, _):
        servo.set_mode("velocity")
        with traffic(bus) as sent, pytest.raises(RequestError, match="mode velocity, not position"):
            servo.move(1.0)
        assert writes(sent) == []


def test_a_servo_that_cannot_get_there_stalls_and_says_why() -> None:
    with world() as (_, servo, _):
        servo.write(torque_limit=0.0)
        with pytest.raises(Stalled) as caught:
            servo.move(2.5)
        assert "torque_limit is 0" in caught.value.cause


def test_a_slow_move_of_a_coarse_servo_is_no_stall() -> None:
    with world("scs") as (_, servo, _):
        here = servo.position()
        servo.move(here + 0.1, velocity=0.06, tolerance=0.01)
        assert servo.position() == pytest.approx(here + 0.1, abs=0.011)


def test_a_move_that_is_late_raises() -> None:
    with world() as (_, servo, _), pytest.raises(MotionError, match="after 0.2 s"):
        servo.move(4.0, velocity=0.5, timeout=0.2)


def test_a_cancelled_move_stops_and_holds() -> None:
    async def main(url: str) -> tuple[float, str]:
        async with motorbus.open_async(url) as bus:
            servo = AsyncServo(bus, 1)
            await servo.enable_torque()
            task = asyncio.ensure_future(servo.move(4.5, velocity=0.5))
            while await servo.position() < 3.3:
                await asyncio.sleep(0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError) as caught:
                await task
            return await servo.position(), "".join(getattr(caught.value, "__notes__", ()))

    with motorbus.simulate("feetech") as simulation:
        place, note = asyncio.run(main(simulation.url))
        later_place = simulation[1].memory["goal_position"] * 6.2832 / 4096
        assert 3.3 <= place < 4.0
        assert later_place == pytest.approx(place, abs=0.1)
        assert "holds" in note


def test_many_turns_are_counted_and_forgotten_turns_are_noticed() -> None:
    with world() as (bus, servo, _):
        servo.set_multi_turn(True)
        servo.enable_torque()
        servo.move(20.0)
        assert servo.position() == pytest.approx(20.0, abs=0.05)
        assert servo.stop() is Promise.HOLD_ACCEPTED
        later(bus, 0.5)
        assert servo.position() == pytest.approx(20.0, abs=0.05)


def test_goals_over_many_turns_with_a_position_within_one_are_refused() -> None:
    with world() as (bus, servo, simulation):
        for row in ("min_position_limit", "max_position_limit"):
            simulation[1].memory[row] = 0
        with traffic(bus) as sent:
            for refused in (servo.enable_torque, servo.stop, lambda: servo.move(8.0)):
                with pytest.raises(RequestError, match="may be turns away"):
                    refused()
        assert writes(sent) == []
        servo.disable_torque()


@pytest.mark.parametrize("name", TABLES)
def test_disable_torque_ignores_alarms_and_needs_no_identity(name: str) -> None:
    with world(name) as (bus, servo, simulation):
        servo.enable_torque()
        simulation[1].alarm = 0x20
        with traffic(bus) as sent:
            Servo(bus, 1).disable_torque()
        assert sent == ["01 04 03 28 00"]
        assert simulation[1].memory["torque_enable"] == 0


@pytest.mark.parametrize("name", [name for name in TABLES if TRAITS[name].limit])
def test_cap_torque_releases_a_servo_and_gives_it_back_without_a_jump(name: str) -> None:
    with world(name) as (bus, servo, simulation):
        servo.enable_torque()
        servo.cap_torque(0)
        stood = shaft(simulation, bus)
        simulation[1].memory["goal_position"] = 900
        servo.cap_torque(1.0)
        later(bus, 1.0)
        assert shaft(simulation, bus) == pytest.approx(stood, abs=2)
        for wrong in (-0.1, 1.1, nan, True):
            with pytest.raises(RequestError):
                servo.cap_torque(wrong)


def test_caps_are_refused_where_no_register_of_ram_holds_them() -> None:
    with world("scs") as (_, servo, _):
        with pytest.raises(RequestError, match="EEPROM"):
            servo.cap_torque(0.5)
        with pytest.raises(RequestError):
            servo.cap_current(0.5)


def test_a_bound_of_the_current_is_kept_by_later_moves_and_never_0() -> None:
    with world("hls") as (_, servo, simulation):
        memory = simulation[1].memory
        servo.enable_torque()
        assert memory["goal_torque"] == memory["protection_current"] > 0
        servo.cap_current(0.5)
        bound = memory["goal_torque"]
        assert 0 < bound < memory["protection_current"]
        servo.move(servo.position() + 0.2)
        assert memory["goal_torque"] == bound
        memory["goal_torque"] = 0  # by another program
        other = Servo(servo.bus, 1)
        other.move(other.position() - 0.2)
        assert memory["goal_torque"] == bound


@pytest.mark.parametrize("name", TABLES)
def test_torque_that_is_off_at_once_is_noticed(name: str) -> None:
    """Its supply fails by the inrush of its own motor."""
    with world(name) as (bus, servo, simulation):
        link: Any = bus.link
        write = link.write

        def cut(data: bytes) -> None:
            if data[4:7] == b"\x02\x28\x01":  # the switch is read back
                simulation[1].power_cycle()
            write(data)

        link.write = cut
        with pytest.raises(MotionError) as caught:
            servo.enable_torque()
        assert "lost its supply" in caught.value.cause
