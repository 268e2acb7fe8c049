"""Every verb of movement on a simulated servo of every map: nothing jumps, and everything goes where it was sent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import tau
from typing import Any

import pytest

import motorbus
from motorbus.bus.blocking import Bus
from motorbus.core.steps import Sleep
from motorbus.errors import RequestError
from motorbus.families.feetech import (
    Servo,
    driver,
    read_positions,
    sync_read,
    sync_write,
    sync_write_positions,
)
from motorbus.families.feetech.driver import Powerless, Promise
from motorbus.families.feetech.table import CONTROL, TABLES, Mode
from tests.families.feetech.maps import MODELS

COUNT = tau / 4096
RATES = {"smbl": 115_200, "smcl": 115_200}
"""bit/s at which servos of a map ship, where that is not 1000000."""
MODES = [(name, mode) for name in TABLES for mode in CONTROL[name].has if (name, mode) != ("hls", Mode.PWM)]


@contextmanager
def world(name: str, **options: Any) -> Iterator[tuple[Bus, Servo, Any]]:
    """A bus with servo 1 of this map, and what is behind it."""
    told = {"ids": "1", "model": MODELS[name], **options}
    with (
        motorbus.simulate("feetech", **told) as sim,
        motorbus.open(sim.url, baud=RATES.get(name, 1_000_000)) as bus,
    ):
        yield bus, Servo(bus, 1), sim[1]


def later(bus: Bus, seconds: float) -> None:
    bus.run(Sleep(seconds))


@pytest.mark.parametrize("name", TABLES)
def test_it_moves_holds_and_stops(name: str) -> None:
    with world(name) as (bus, servo, _simulated):
        here = servo.position()
        servo.move(here + 0.5)
        assert servo.position() == pytest.approx(here + 0.5, abs=0.06)
        servo.move(here - 0.5, velocity=1.0, wait=False)
        later(bus, 0.3)
        assert servo.stop() is Promise.HOLD_ACCEPTED
        later(bus, 0.5)
        stood = servo.position()
        assert here - 0.45 < stood < here + 0.45
        later(bus, 0.5)
        assert servo.position() == pytest.approx(stood, abs=0.02)
        assert not servo.telemetry().moving
        servo.disable_torque()
        assert servo.read_raw("torque_enable") == {"torque_enable": 0}


@pytest.mark.parametrize("name", TABLES)
def test_torque_comes_on_without_a_jump(name: str) -> None:
    with world(name) as (bus, servo, simulated):
        servo.move(servo.position() + 0.4)
        servo.disable_torque()
        simulated.raw_position = simulated.raw_position - 60
        stands = simulated.raw_position
        servo.enable_torque()
        later(bus, 1.0)
        assert abs(simulated.raw_position - stands) <= 1
        assert servo.read_raw("torque_enable") == {"torque_enable": 1}


@pytest.mark.parametrize("name", TABLES)
def test_a_sample_tells_what_the_verbs_tell(name: str) -> None:
    with world(name) as (_bus, servo, _simulated):
        state = servo.telemetry()
        assert state.position == servo.position()
        assert (state.velocity, state.load) == (servo.velocity(), servo.load())
        assert (state.voltage, state.temperature) == (servo.voltage(), servo.temperature())
        assert (state.moving, state.alarm) == (False, ())
        assert (state.current is None) == (name == "scs")


@pytest.mark.parametrize("name", TABLES)
def test_verbs_of_one_servo_address_nobody_else(name: str) -> None:
    with world(name) as (bus, servo, _simulated):
        trace = bus.trace.subscribe(limit=1_000_000)
        servo.ping()
        servo.enable_torque()
        servo.move(servo.position() + 0.2)
        servo.stop()
        servo.set_mode("pwm" if CONTROL[name].duty else "velocity")
        servo.write(led_mask=1)
        servo.reg_write(goal_velocity=0.5)
        servo.action()
        servo.disable_torque()
        sent = [one.data for one in trace if one.direction == "tx" and isinstance(one.data, bytes)]
        assert {request[2] for request in sent} == {1}


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_a_mode_is_set_for_good_and_begins_at_rest(name: str, mode: Mode) -> None:
    with world(name) as (bus, servo, simulated):
        servo.move(servo.position() + 0.4, velocity=2.0)
        servo.set_mode(mode)
        assert servo.read_raw("torque_enable", "lock") == {"torque_enable": 0, "lock": 1}
        simulated.power_cycle()
        assert servo.mode() is mode
        stands = servo.position()
        servo.enable_torque()
        later(bus, 1.0)
        assert servo.position() == pytest.approx(stands, abs=0.01)


@pytest.mark.parametrize("name", [name for name in TABLES if Mode.VELOCITY in CONTROL[name].has])
def test_a_velocity_turns_it_and_stop_ends_that(name: str) -> None:
    with world(name) as (bus, servo, _simulated):
        servo.set_mode("velocity")
        servo.enable_torque()
        servo.set_velocity(1.0)
        later(bus, 1.0)
        assert servo.velocity() == pytest.approx(1.0, abs=0.08)
        assert servo.stop() is Promise.ZERO_VELOCITY_ACCEPTED
        later(bus, 0.5)
        assert servo.velocity() == 0.0


@pytest.mark.parametrize(("name", "mode"), [one for one in MODES if one[1] is Mode.PWM])
def test_a_duty_turns_it_and_stop_ends_that(name: str, mode: Mode) -> None:
    with world(name) as (bus, servo, _simulated):
        servo.set_mode(mode)
        servo.enable_torque()
        servo.set_duty(0.3)
        later(bus, 0.5)
        assert servo.velocity() != 0.0
        assert servo.stop() is Promise.ZERO_DUTY_ACCEPTED
        later(bus, 1.0)
        assert servo.velocity() == 0.0


def test_a_current_pushes_and_stop_ends_that() -> None:
    with world("hls") as (bus, servo, _simulated):
        servo.set_mode("current")
        servo.enable_torque()
        servo.set_current(0.5)
        later(bus, 0.5)
        assert servo.velocity() != 0.0
        assert servo.stop() is Promise.ZERO_CURRENT_ACCEPTED
        later(bus, 2.0)
        assert servo.velocity() == pytest.approx(0.0, abs=0.01)
        servo.set_mode("position")
        servo.move(servo.position() + 0.3)


@pytest.mark.parametrize("name", ["sts", "smbl"])
def test_steps_add_up_over_the_end_of_a_turn(name: str) -> None:
    with world(name) as (bus, servo, simulated):
        servo.set_mode("step")
        servo.write(min_position_limit=0, max_position_limit=0)
        before = simulated.motion.position(bus.link.now())
        for _ in range(3):
            servo.step(2.0, velocity=4.0)
        gone = simulated.motion.position(bus.link.now()) - before
        assert gone * COUNT == pytest.approx(6.0, abs=0.16)


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_a_motor_becomes_a_servo_again(name: str) -> None:
    with world(name) as (bus, servo, _simulated):
        limits = servo.read_raw("min_position_limit", "max_position_limit")
        servo.set_mode("pwm")
        with pytest.raises(RequestError, match="nobody here knows which"):
            Servo(bus, 1).set_mode("position")
        servo.set_mode("position")
        assert servo.read_raw("min_position_limit", "max_position_limit") == limits


@pytest.mark.parametrize("name", TABLES)
def test_everything_works_on_a_servo_that_acknowledges_nothing(name: str) -> None:
    with world(name) as (bus, servo, _simulated):
        servo.write(status_return_level=0)
        here = servo.position()
        servo.enable_torque()
        servo.move(here + 0.3)
        assert servo.stop() is Promise.HOLD_ACCEPTED
        servo.reg_write(goal_position=here)
        servo.action()
        later(bus, 1.0)
        assert servo.position() == pytest.approx(here, abs=0.06)
        servo.set_mode("pwm" if CONTROL[name].duty else "velocity")
        servo.disable_torque()
        assert servo.read_raw("torque_enable", "lock") == {"torque_enable": 0, "lock": 1}


def test_the_trap_of_hls_is_avoided_and_told() -> None:
    with world("hls") as (bus, servo, simulated):
        simulated.memory["goal_torque"] = 0
        told: list[object] = []
        bus.report = told.append
        here = servo.position()
        servo.move(here + 0.4)
        assert servo.position() == pytest.approx(here + 0.4, abs=0.06)
        assert [type(event) for event in told] == [Powerless]
        assert simulated.memory["goal_torque"] == simulated.memory["protection_current"]


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_many_turns_are_gone_and_told_when_the_phase_says_so(name: str) -> None:
    with world(name) as (bus, servo, simulated):
        simulated.memory["phase"] = simulated.memory["phase"] | 1 << 4
        servo.write(min_position_limit=0, max_position_limit=0)
        servo.move(3 * tau, timeout=60.0)
        assert servo.position() == pytest.approx(3 * tau, abs=0.06)
        servo.enable_torque()
        assert servo.stop() is Promise.HOLD_ACCEPTED
        later(bus, 1.0)
        assert servo.position() == pytest.approx(3 * tau, abs=0.06)


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_many_turns_are_gone_and_judged_within_one_as_shipped(name: str) -> None:
    with world(name) as (bus, servo, simulated):
        servo.write(min_position_limit=0, max_position_limit=0)
        before = simulated.motion.position(bus.link.now())
        goal = servo.position() + 2 * tau
        servo.move(goal, timeout=60.0)
        assert (simulated.motion.position(bus.link.now()) - before) * COUNT == pytest.approx(
            2 * tau, abs=0.06
        )
        with pytest.raises(RequestError, match="nobody knows on which turn"):
            servo.stop()


def test_a_bus_of_all_maps_is_read_and_moved_as_one() -> None:
    names = ["sts", "scs", "hls", "scs2"]
    model = "+".join(MODELS[name] for name in names)
    with motorbus.simulate("feetech", ids="1-4", model=model) as sim, motorbus.open(sim.url) as bus:
        servos = [Servo(bus, node) for node in range(1, 5)]
        for servo in servos:
            servo.enable_torque()
        start = bus.run(read_positions(servos))
        assert (list(start.values), start.missing) == ([1, 2, 3, 4], ())
        bus.run(sync_write_positions(servos, [start.values[servo.node] + 0.3 for servo in servos]))
        later(bus, 2.0)
        sim[4].unplug()
        found = bus.run(read_positions(servos))
        assert found.missing == (4,)
        for node in (1, 2, 3):
            assert found.values[node] == pytest.approx(start.values[node] + 0.3, abs=0.06)
        voltages = bus.run(sync_read(["present_voltage"], servos))
        assert set(voltages.values) == {1, 2, 3}
        assert set(voltages.errors) == {4}
        bus.run(sync_write({servo: {"torque_enable": 0} for servo in servos}))
        later(bus, 0.001)
        assert [sim[node].memory["torque_enable"] for node in (1, 2, 3)] == [0, 0, 0]


def test_a_group_whose_servos_were_never_asked_is_read_whatever_its_maps() -> None:
    with (
        motorbus.simulate("feetech", ids="1-2", model="sts3215+scs0009") as sim,
        motorbus.open(sim.url) as bus,
    ):
        result = bus.run(driver.sync_read(["present_position", "id"], [1, 2]))
        assert {node: values["id"] for node, values in result.values.items()} == {1: 1, 2: 2}
