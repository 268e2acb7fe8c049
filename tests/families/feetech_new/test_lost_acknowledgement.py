"""A reply is lost at any exchange of a command: success means that the servo did it, and a step is made once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import motorbus
from motorbus import MotorbusError, OutcomeUnknown
from motorbus.families.feetech_new import Servo

MODELS = ("sts3215", "sm85blhv", "scs0009", "hls3925")
EXCHANGES = range(1, 15)
"""More than the longest of these commands has."""


@contextmanager
def holding(model: str) -> Iterator[tuple[Any, Servo]]:
    with motorbus.simulate("feetech", model=model) as simulation, motorbus.open(simulation.url) as bus:
        servo = Servo(bus, 1)
        servo.enable_torque()
        yield simulation, servo


COMMANDS: dict[str, tuple[Callable[[Servo], object], Callable[[Servo], bool]]] = {
    "write RAM": (
        lambda servo: servo.write(goal_velocity=1.0),
        lambda servo: near(servo.read("goal_velocity"), 1.0),
    ),
    "write EEPROM": (
        lambda servo: servo.write(max_temperature=55.0),
        lambda servo: near(servo.read("max_temperature"), 55.0),
    ),
    "enable torque": (
        lambda servo: servo.enable_torque(),
        lambda servo: near(servo.read("torque_enable"), 1),
    ),
    "disable torque": (
        lambda servo: servo.disable_torque(),
        lambda servo: near(servo.read("torque_enable"), 0),
    ),
    "move": (lambda servo: servo.move(2.4, wait=False), lambda servo: near(servo.read("goal_position"), 2.4)),
    "stop": (lambda servo: servo.stop(), lambda servo: near(servo.read("goal_position"), servo.position())),
    "write gain": (
        lambda servo: servo.write(position_p=20),
        lambda servo: near(servo.read("position_p"), 20),
    ),
}


def near(read: dict[str, Any], value: float) -> bool:
    (held,) = read.values()
    return abs(float(held) - value) < 0.02


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", COMMANDS)
def test_success_means_that_the_servo_did_it(model: str, name: str) -> None:
    command, done = COMMANDS[name]
    struck = 0
    for request in EXCHANGES:
        with holding(model) as (simulation, servo):
            simulation.faults = f"exchange {request}: drop"
            try:
                command(servo)
            except MotorbusError:
                succeeded = False
            else:
                succeeded = True
            struck += simulation.faults.count
            simulation.faults = ""
            assert done(servo) or not succeeded, f"reply {request} lost"
    assert struck >= 1
    assert succeeded, "the last exchange is beyond the command, so nothing was lost"


@pytest.mark.parametrize("model", ["sts3215", "sm85blhv"])
def test_a_step_is_never_made_twice(model: str) -> None:
    unknown = 0
    for request in EXCHANGES:
        with holding(model) as (simulation, servo):
            servo.set_mode("step")
            servo.enable_torque()
            start = servo.position()
            simulation.faults = f"exchange {request}: drop"
            try:
                servo.step(0.2, wait=False)
            except OutcomeUnknown:
                unknown += 1
            simulation.faults = ""
            simulation.wait(simulation.now + 3.0)
            assert servo.position() - start == pytest.approx(0.2, abs=0.02)
    assert unknown == 1
