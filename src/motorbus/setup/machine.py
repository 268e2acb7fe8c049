"""The machine file of a calibrated arm."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from motorbus.motion.machine import FORMAT, MachineConfig
from motorbus.motion.machine_edit import HEAD, edit
from motorbus.setup.calibrate import TURN, JointCalibration
from motorbus.setup.presets import Preset

MARGIN: Final = 2.0  # deg between the ends of the sweep and the limits


def axes_of(
    preset: Preset, calibration: Mapping[str, JointCalibration], arm: str
) -> dict[str, dict[str, Any]]:
    """The tables of the axes of this arm, by name: the joint, behind the name of the arm if it is not `arm`."""
    axes = {}
    for joint in preset.joints:
        if (one := calibration.get(joint.name)) is None:
            continue
        middle = (one.range_min + one.range_max) / 2
        reach = (one.range_max - one.range_min) / 2 * 360 / TURN
        reach = max(reach - MARGIN, reach / 2)
        table: dict[str, Any] = {"device": f"{arm}#{one.id}", "zero": f"{middle * 360 / TURN:.6g} deg"}
        if one.drive_mode:
            table["sign"] = -1
        table |= {"low": f"{-reach:.2f} deg", "high": f"{reach:.2f} deg", "max_velocity": preset.max_velocity}
        optional: dict[str, Any] = {"max_torque": joint.max_torque}
        if joint.parent is None or joint.parent in calibration:
            parent = joint.parent and axis_name(arm, joint.parent)
            optional |= {"parent": parent, "frame": joint.frame, "tip": joint.tip}
        table |= {key: value for key, value in optional.items() if value is not None}
        axes[axis_name(arm, joint.name)] = table
    return axes


def axis_name(arm: str, joint: str) -> str:
    """The name of the axis of a joint."""
    return joint if arm == "arm" else f"{arm}_{joint}"


def update(
    path: Path, preset: Preset, calibration: Mapping[str, JointCalibration], *, address: str, arm: str
) -> MachineConfig:
    """Write these joints into a machine file, or a new one; what else it holds stays. Gives the machine."""
    text = path.read_text("utf-8") if path.exists() else f"{HEAD}\nformat = {FORMAT}\n"
    machine = MachineConfig.parse(text, str(path))
    changes: dict[str, object] = {}
    if arm not in machine.buses:
        changes[f"bus.{arm}"] = {"address": address}
    elif machine.buses[arm].address != address:
        changes[f"bus.{arm}.address"] = address
    axes = axes_of(preset, calibration, arm)
    for name, table in axes.items():
        if name in machine.axes:
            changes |= {f"axis.{name}.{key}": value for key, value in table.items()}
        else:
            changes[f"axis.{name}"] = table
    text = edit(text, changes)
    machine = MachineConfig.parse(text, str(path))
    path.write_text(text, "utf-8")
    return machine


def recalibrated(path: Path, preset: Preset, calibration: Mapping[str, JointCalibration]) -> str:
    """The text of a machine file with other zero, low and high of these axes, which are joints of `preset`.

    Raises RequestError if it is no machine then, as by a pose outside of the new limits.
    """
    changes = {
        f"axis.{name}.{key}": table[key]
        for name, table in axes_of(preset, calibration, "arm").items()
        for key in ("zero", "low", "high")
    }
    return edit(path.read_text("utf-8"), changes)


def calibration_of(
    machine: MachineConfig, preset: Preset, found: Mapping[str, JointCalibration], arm: str
) -> dict[str, JointCalibration]:
    """What the servos hold, with the direction of the machine file."""
    known = {}
    for name, one in found.items():
        axis = machine.axes.get(axis_name(arm, name))
        reversed_ = axis is not None and axis.sign < 0
        known[name] = JointCalibration(
            one.id, int(reversed_), one.homing_offset, one.range_min, one.range_max
        )
    return known
