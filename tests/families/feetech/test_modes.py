"""Operating modes, and orders in them."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, OutcomeUnknown, RequestError
from motorbus.families.feetech import Servo
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS, Mode
from tests.families.feetech.worlds import MODES, later, put_mode, traffic, world, writes

ORDERS: dict[Mode, tuple[str, float]] = {
    Mode.VELOCITY: ("set_velocity", 3.0),
    Mode.PWM: ("set_duty", 0.6),
    Mode.CURRENT: ("set_current", 1.0),
}
ORDERED = [(name, mode) for name, mode in MODES if mode in ORDERS]


def shaft(simulation: Any, bus: Any) -> float:
    return float(simulation[1].motion.position(bus.link.now()))


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_a_mode_is_kept_and_the_servo_is_limp(name: str, mode: Mode) -> None:
    with world(name) as (bus, servo, simulation):
        servo.enable_torque()
        put_mode(servo, mode)
        assert servo.mode() is mode
        assert servo.read_raw("torque_enable", "lock") == {"torque_enable": 0, "lock": 1}
        simulation[1].power_cycle()
        later(bus, 1.0)
        assert servo.mode() is mode


@pytest.mark.parametrize(("name", "mode"), ORDERED)
def test_an_order_turns_a_servo_with_torque_and_not_a_limp_one(name: str, mode: Mode) -> None:
    with world(name) as (bus, servo, simulation):
        put_mode(servo, mode)
        stood = shaft(simulation, bus)
        verb, value = ORDERS[mode]
        getattr(servo, verb)(value)
        later(bus, 0.5)
        assert shaft(simulation, bus) == pytest.approx(stood, abs=1)
        servo.enable_torque()
        later(bus, 0.5)
        assert shaft(simulation, bus) == pytest.approx(stood, abs=1)  # what was ordered before is forgotten
        getattr(servo, verb)(value)
        later(bus, 1.0)
        assert abs(shaft(simulation, bus) - stood) > 20


@pytest.mark.parametrize(
    ("name", "mode", "then"),
    [(name, mode, then) for name, mode in ORDERED for other, then in MODES if other == name],
)
def test_an_order_is_not_remembered_over_a_change_of_mode(name: str, mode: Mode, then: Mode) -> None:
    with world(name) as (bus, servo, simulation):
        put_mode(servo, mode)
        verb, value = ORDERS[mode]
        getattr(servo, verb)(value)
        put_mode(servo, then)
        stood = shaft(simulation, bus)
        servo.enable_torque()
        later(bus, 2.0)
        assert shaft(simulation, bus) == pytest.approx(stood, abs=2)


@pytest.mark.parametrize("name", TABLES)
def test_a_mode_that_the_map_lacks_is_refused(name: str) -> None:
    with world(name) as (bus, servo, _):
        servo.prepare()
        with traffic(bus) as sent:
            for mode in {*Mode} - {*TRAITS[name].has} | ({Mode.PWM} if name == "hls" else set()):
                with pytest.raises(RequestError):
                    servo.set_mode(mode)
            with pytest.raises(RequestError):
                servo.set_mode("nonsense")
        assert writes(sent) == []


def test_an_scs_becomes_a_servo_again_by_known_limits() -> None:
    with world("scs") as (_, servo, _simulation):
        before = servo.read("limits")
        servo.set_mode("pwm")
        assert servo.read_raw("limits") == {"min_position_limit": 0, "max_position_limit": 0}
        known, servo.known.former_limits = servo.known.former_limits, None
        with pytest.raises(RequestError, match="needs limits"):
            servo.set_mode("position")
        servo.known.former_limits = known
        servo.set_mode("position")
        assert servo.read("limits") == before
        for wrong in ((4.0, 0.5), (-1.0, 1.0), (0.0, 99.0)):
            with pytest.raises(RequestError):
                servo.set_mode("position", limits=wrong)


def test_an_hls_that_leaves_current_mode_is_bounded_by_its_protection_current() -> None:
    with world("hls") as (_, servo, simulation):
        servo.set_mode("current")
        servo.enable_torque()
        servo.set_current(0.1)
        servo.set_mode("position")
        assert simulation[1].memory["goal_torque"] == simulation[1].memory["protection_current"]


def test_an_unknown_mode_is_named_and_commanded_no_more() -> None:
    with world() as (bus, servo, simulation):
        simulation[1].memory["operating_mode"] = 3
        simulation[1].memory.live[33] = 7
        with traffic(bus) as sent:
            for refused in (servo.mode, servo.enable_torque, servo.stop, lambda: servo.move(1.0)):
                with pytest.raises(RequestError, match="mode 7"):
                    refused()
            assert servo.identify().details["mode"] == "unknown (7)"
        assert writes(sent) == []
        servo.set_mode("position")
        assert servo.mode() is Mode.POSITION


class TestVelocity:
    def test_it_turns_both_ways_and_jogs(self) -> None:
        with world() as (bus, servo, _):
            servo.set_mode("velocity")
            servo.enable_torque()
            for velocity in (1.0, -1.0):
                servo.set_velocity(velocity, acceleration=20.0)
                later(bus, 0.5)
                assert servo.velocity() == pytest.approx(velocity, abs=0.08)
            servo.jog(2.0, 0.5)
            later(bus, 0.5)
            assert servo.velocity() == 0.0

    @pytest.mark.parametrize("phase", [12, 8])
    def test_its_unit_follows_the_phase_bit(self, phase: int) -> None:
        with world() as (_bus, servo, simulation):
            simulation[1].memory["phase"] = phase
            servo.set_mode("velocity")
            servo.enable_torque()
            servo.set_velocity(3.0)
            assert simulation[1].memory["goal_velocity"] == (1956 if phase == 12 else 39)

    def test_smcl_takes_no_negative_velocity(self) -> None:
        with world("smcl") as (bus, servo, _):
            servo.set_mode("velocity")
            servo.enable_torque()
            with traffic(bus) as sent, pytest.raises(RequestError):
                servo.set_velocity(-1.0)
            assert writes(sent) == []

    @pytest.mark.parametrize("velocity", [nan, 1e9, "1"])
    def test_it_takes_numbers_that_its_register_holds(self, velocity: Any) -> None:
        with world() as (bus, servo, _):
            servo.set_mode("velocity")
            servo.enable_torque()
            with traffic(bus) as sent, pytest.raises((RequestError, LimitExceeded)):
                servo.set_velocity(velocity)
            assert writes(sent) == []


@pytest.mark.parametrize(
    ("verb", "value"),
    [("set_velocity", 1.0), ("set_duty", 0.1), ("set_current", 0.1), ("step", 0.1), ("jog", 1.0)],
)
def test_an_order_in_another_mode_is_refused(verb: str, value: float) -> None:
    with world() as (bus, servo, _):
        servo.enable_torque()
        with traffic(bus) as sent, pytest.raises(RequestError):
            getattr(servo, verb)(value, *([0.1] if verb == "jog" else []))
        assert [one for one in writes(sent) if one.split(" ")[3] != "2a"] == []


@pytest.mark.parametrize("duty", [1.5, -1.1, nan, "1"])
def test_a_duty_is_between_minus_1_and_1(duty: Any) -> None:
    with world() as (bus, servo, _):
        servo.set_mode("pwm")
        with traffic(bus) as sent, pytest.raises((RequestError, LimitExceeded)):
            servo.set_duty(duty)
        assert writes(sent) == []


@pytest.mark.parametrize("name", ["sts", "scs"])
def test_a_negative_duty_has_its_sign_at_bit_10(name: str) -> None:
    with world(name) as (bus, servo, _):
        servo.set_mode("pwm")
        servo.enable_torque()
        with traffic(bus) as sent:
            servo.set_duty(-0.2)
        assert sent == ["01 05 03 2c c8 04" if name == "sts" else "01 05 03 2c 04 c8"]


def test_the_time_of_an_scs_is_a_plain_number_up_to_65_s() -> None:
    with world("scs") as (_, servo, _simulation):
        servo.enable_torque()
        servo.write(goal_time=1500)
        assert servo.read("goal_time") == {"goal_time": 1500}
        with pytest.raises(RequestError):
            servo.write(goal_time=-1)


class TestStep:
    @pytest.mark.parametrize("name", ["sts", "smbl"])
    @pytest.mark.parametrize("by", [0.4, -0.4, 9.0])
    def test_it_goes_from_here_over_the_end_of_a_turn(self, name: str, by: float) -> None:
        with world(name) as (bus, servo, simulation):
            servo.set_mode("step")
            start = shaft(simulation, bus)
            servo.step(by)
            moved = (shaft(simulation, bus) - start) * 6.2832 / 4096
            assert moved == pytest.approx(by, abs=0.06)

    def test_it_is_never_sent_twice(self) -> None:
        with world() as (bus, servo, simulation):
            servo.set_mode("step")
            servo.enable_torque()
            start = shaft(simulation, bus)
            simulation.faults = "exchange 2: drop"
            with pytest.raises(OutcomeUnknown):
                servo.step(0.2, wait=False)
            simulation.faults = ""
            later(bus, 2.0)
            assert (shaft(simulation, bus) - start) * 6.2832 / 4096 == pytest.approx(0.2, abs=0.02)

    @pytest.mark.parametrize("by", [1e6, nan])
    def test_it_goes_at_most_7_and_a_half_turns(self, by: float) -> None:
        with world() as (bus, servo, _):
            servo.set_mode("step")
            with traffic(bus) as sent, pytest.raises(LimitExceeded):
                servo.step(by)
            assert writes(sent) == []


@pytest.mark.parametrize("seconds", [nan, -1.0, "2"])
def test_a_jog_without_an_end_is_refused_before_it_turns(seconds: Any) -> None:
    with world("sts") as (bus, servo, _):
        put_mode(servo, Mode.VELOCITY)
        servo.enable_torque()
        with traffic(bus) as sent, pytest.raises(RequestError, match="cannot turn for"):
            servo.jog(1.0, seconds)
        assert writes(sent) == []


def test_a_mode_that_another_object_has_set_is_known_before_a_move() -> None:
    with world("sts") as (bus, servo, simulation):
        servo.enable_torque()
        put_mode(Servo(bus, 1), Mode.VELOCITY)
        Servo(bus, 1).enable_torque()
        servo.position()
        stood = shaft(simulation, bus)
        with pytest.raises(RequestError, match="operating mode velocity"):
            servo.move(2.0, velocity=2.0)
        later(bus, 1.0)
        assert shaft(simulation, bus) == pytest.approx(stood, abs=1)


def test_a_current_bound_gives_force_back_without_a_jump() -> None:
    with world("hls") as (bus, servo, simulation):
        servo.move(3.0)
        simulation[1].memory["goal_torque"] = 0
        simulation[1].move()
        simulation[1].push_shaft(0.8)
        later(bus, 2.0)
        servo.cap_current(0.5)
        later(bus, 1.0)
        assert servo.position() == pytest.approx(3.8, abs=0.01)
