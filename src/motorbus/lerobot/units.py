"""Positions of joints as LeRobot has them, and as the axes of a machine have them.

An axis is at 0 in the middle of its calibrated range. LeRobot's degrees are 360/4095 of a count, those of an axis
360/4096; the gripper is 0 to 100 of its range, other joints without `use_degrees` -100 to 100.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from motorbus.motion.machine import MachineConfig
from motorbus.setup.calibrate import COUNT, TURN, JointCalibration
from motorbus.setup.lerobot import STEPS
from motorbus.setup.presets import Preset

GRIPPER = "gripper"


@dataclass(frozen=True, slots=True)
class JointUnit:
    """`value = position * scale + middle`, at most `low` to `high`; position in rad."""

    scale: float
    middle: float
    low: float
    high: float

    def value(self, position: float) -> float:
        """A position (rad) in the unit of LeRobot."""
        return min(max(position * self.scale + self.middle, self.low), self.high)

    def position(self, value: float) -> float:
        """A value in the unit of LeRobot as a position (rad)."""
        return (min(max(value, self.low), self.high) - self.middle) / self.scale


def unit_of(joint: str, one: JointCalibration, *, use_degrees: bool) -> JointUnit:
    """The unit of a joint."""
    if use_degrees and joint != GRIPPER:
        return JointUnit(math.degrees(TURN / STEPS), 0.0, -math.inf, math.inf)
    low = 0.0 if joint == GRIPPER else -100.0
    reach = (one.range_max - one.range_min) * COUNT / 2
    middle = (low + 100.0) / 2
    sign = -1 if one.drive_mode else 1
    return JointUnit(sign * (100.0 - middle) / reach, middle, low, 100.0)


def machine_of(
    address: str,
    preset: Preset,
    calibration: Mapping[str, JointCalibration],
    *,
    max_velocity: float,
    exit: str,
) -> MachineConfig:
    """The machine of an arm: axes named as its joints, 0 in the middle of the calibrated range."""
    axes: dict[str, dict[str, Any]] = {}
    for joint in preset.joints:
        one = calibration[joint.name]
        reach = (one.range_max - one.range_min) / 2 * 360 / TURN
        axes[joint.name] = {
            "device": f"arm#{one.id}",
            "zero": f"{(one.range_min + one.range_max) / 2 * 360 / TURN} deg",
            "low": f"{-reach} deg",
            "high": f"{reach} deg",
            "max_velocity": f"{max_velocity} deg/s",
            "max_acceleration": f"{max_velocity * 20} deg/s2",
            "exit": exit,
        }
    return MachineConfig.of({"format": 1, "bus": {"arm": {"address": address}}, "axis": axes})
