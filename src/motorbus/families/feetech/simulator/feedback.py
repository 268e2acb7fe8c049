"""What the feedback registers say, worked out for the moment at which somebody reads them.

Load is the duty of the power stage and not the torque, current is that of the supply: both follow from how fast
the shaft turns and from what the outside takes (`Servo.torque`), so they are plausible and no more. On HLS the current
is that of the motor's phase, which goes with the torque alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.table import AMPERE, tells_current


def _velocity(servo: Servo, at: float) -> int:
    return round(servo.facing * servo.motion.velocity(at) / servo.asked.unit)


def _load(servo: Servo, at: float) -> int:
    return round(1000 * servo.facing * servo.duty(at))


def _voltage(servo: Servo, at: float) -> int:
    return servo.told_voltage


def _temperature(servo: Servo, at: float) -> int:
    return round(servo.temperature)


def _pending(servo: Servo, at: float) -> int:
    return int(servo.pending is not None)


def _error(servo: Servo, at: float) -> int:
    return servo.error


def _moving(servo: Servo, at: float) -> int:
    """Bit 0: it moves. On HLS bit 1 says that the goal is not reached (HLS memory table)."""
    moving = int(servo.motion.moving(at))
    if 1 in servo.model.table["moving"].bits and not servo.arrived(at):
        moving |= 2
    return moving


def _goal(servo: Servo, at: float) -> int:
    return servo.memory["goal_position"]


def _current(servo: Servo, at: float) -> int:
    if not tells_current(servo.memory["phase"], servo.model.table.name):
        return 0
    return round(servo.facing * servo.current(at) / AMPERE)


FEEDBACK: Final[Mapping[str, Callable[[Servo, float], int]]] = MappingProxyType(
    {
        "present_position": Servo.position,
        "present_velocity": _velocity,
        "present_load": _load,
        "present_voltage": _voltage,
        "present_temperature": _temperature,
        "reg_write_pending": _pending,
        "hardware_error": _error,
        "moving": _moving,
        "goal_position_echo": _goal,
        "present_current": _current,
    }
)
"""Row name -> raw value at a moment."""


def read(servo: Servo, address: int, count: int, at: float) -> bytes:
    """The bytes a READ gets."""
    memory = servo.memory
    asked = memory.layout.told.get((address, count))
    if asked is None:
        rows = [row.name for row in memory.layout.touched(address, count)]
        asked = tuple((name, FEEDBACK[name]) for name in rows if name in FEEDBACK)
        memory.layout.told[address, count] = asked
    tell = memory.tell
    for name, worked_out in asked:
        tell(name, worked_out(servo, at))
    return memory.read(address, count)
