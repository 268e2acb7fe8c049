"""What a limp servo was told stays in its registers; it must not run off when somebody switches the torque on."""

from __future__ import annotations

from typing import Any

import pytest
from tests.families.feetech.test_driver_every_map import MODES, later, world

from motorbus.families.feetech import Servo
from motorbus.families.feetech.table import CONTROL, Mode

LIMITS = (0.5, 4.0)
ORDERS = {
    Mode.VELOCITY: ("set_velocity", 3.0),
    Mode.PWM: ("set_duty", 0.6),
    Mode.CURRENT: ("set_current", 1.0),
}
"""Mode -> the verb that gives an order in it, and one that would turn the shaft far. A step and a move bring their own
torque."""
ORDERED = [(name, mode) for name, mode in MODES if mode in ORDERS]
CHANGES = [(name, mode, then) for name, mode in ORDERED for other, then in MODES if other == name]
LEFT: dict[str, int] = {"goal_position": 900, "goal_velocity": 600, "goal_time": 500, "goal_torque": 300}
"""What another program may have left in the registers of a servo without torque; the time is a duty in PWM mode."""


def put(servo: Servo, mode: Mode) -> None:
    if CONTROL[servo.identify().table].modes or mode is not Mode.POSITION:
        servo.set_mode(mode)
    else:
        servo.set_mode(mode, limits=LIMITS)


def order(servo: Servo, mode: Mode) -> None:
    verb, value = ORDERS[mode]
    getattr(servo, verb)(value)


def stays(bus: Any, simulated: Any, stood: float) -> None:
    later(bus, 3.0)
    assert simulated.motion.position(bus.link.now()) == pytest.approx(stood, abs=1)


@pytest.mark.parametrize(("name", "mode"), ORDERED, ids=lambda value: getattr(value, "value", value))
def test_an_order_to_a_limp_servo_is_taken_and_forgotten_when_torque_comes_on(name: str, mode: Mode) -> None:
    with world(name) as (bus, servo, simulated):
        put(servo, mode)
        stood = simulated.motion.position(bus.link.now())
        order(servo, mode)
        stays(bus, simulated, stood)  # it is limp
        servo.enable_torque()
        stays(bus, simulated, stood)
        order(servo, mode)
        later(bus, 1.0)
        assert abs(simulated.motion.position(bus.link.now()) - stood) > 20


@pytest.mark.parametrize(("name", "mode", "then"), CHANGES, ids=lambda value: getattr(value, "value", value))
def test_nor_is_it_remembered_over_a_change_of_mode(name: str, mode: Mode, then: Mode) -> None:
    with world(name) as (bus, servo, simulated):
        put(servo, mode)
        stood = simulated.motion.position(bus.link.now())
        order(servo, mode)
        put(servo, then)
        servo.enable_torque()
        stays(bus, simulated, stood)


@pytest.mark.parametrize(("name", "mode"), MODES, ids=lambda value: getattr(value, "value", value))
def test_what_others_have_left_in_the_registers_does_not_move_it(name: str, mode: Mode) -> None:
    """By another object than that which set the mode: it knows nothing of the servo before."""
    with world(name) as (bus, servo, simulated):
        put(servo, mode)
        stood = simulated.motion.position(bus.link.now())
        for row, raw in LEFT.items():
            if row in simulated.model.table:
                simulated.memory[row] = raw
        Servo(bus, 1).enable_torque()
        stays(bus, simulated, stood)
        assert simulated.memory["torque_enable"] == 1
