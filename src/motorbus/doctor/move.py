"""A small movement of each axis, out and back, while its supply is watched. It moves: a face asks first."""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.findings import Finding
from motorbus.core.units import DEGREE
from motorbus.doctor.findings import complete
from motorbus.errors import MotorbusError
from motorbus.motion.robot import Robot

SWING: Final = 3.0  # deg of the device, towards the middle of its range
SPEED: Final = 0.3  # share of the velocity of the axis


def move_axes(robot: Robot) -> list[Finding]:
    """Move each axis that has a position by 3 deg and back, one after the other. Limp axes are limp again after it."""
    found = []
    for name, axis in robot.axes.items():
        if axis.config.is_wheel or "position" not in axis.driver:
            continue
        bus: Any = axis.bus
        is_limp = "health" in axis.driver and bus.run(axis.driver.health(axis.device)).torque is False
        try:
            here = robot.positions(name)[name]
            low, high = axis.config.low, axis.config.high
            swing = SWING * DEGREE / abs(axis.config.ratio)
            if low is not None and high is not None and here > (low + high) / 2:
                swing = -swing
            robot.move({name: here + swing}, speed=SPEED)
            state = robot.states(name)[name]
            robot.move({name: here}, speed=SPEED)
        except MotorbusError as error:
            cause = error.cause or "it is blocked, overloaded, or lost its torque"
            found.append(Finding("motion-blocked", name, error.summary, cause, error.advice))
            continue
        finally:
            if is_limp:
                robot.disable_torque(name)
        if "voltage" in state.alarm:
            evidence = f"supply {state.voltage or 0:.1f} V after a move, its voltage alarm is set"
            found.append(Finding("supply-sag", name, evidence))
    return [complete(one, one.where) for one in found]
