"""What the machine file says of the devices of a bus, against what they say of themselves. Reads only."""

from __future__ import annotations

import os
from collections.abc import Mapping
from math import degrees, isfinite
from pathlib import Path
from typing import Any, Final

from motorbus.core.family import AxisDriver
from motorbus.core.findings import Subject
from motorbus.doctor.bus import BusDoctor
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.machine import AxisConfig, MachineConfig
from motorbus.motion.opening import bus_options
from motorbus.session.journals import unfinished
from motorbus.setup import lerobot
from motorbus.setup.calibrate import JointCalibration

SLACK: Final = 1.0  # deg by which limits may differ
OUTSIDE: Final = 3.0  # deg outside its limits that a limp joint may rest # assumption


def check_journal(doctor: BusDoctor) -> None:
    """An unfinished guarded change of this bus."""
    change = unfinished(doctor.bus)
    if change is not None:
        node = change.facts.get("node")
        where = doctor.name(node) if isinstance(node, int) else doctor.where
        doctor.add("change-unfinished", where, f"unfinished: {change.what or change.verb}")


def check_axes(doctor: BusDoctor, machine: MachineConfig) -> None:
    """The axes of this bus whose devices answer."""
    bus = doctor.where
    try:
        bus_options(machine, bus)
    except RequestError as error:
        doctor.add("axis-mismatch", bus, error.summary, "the family lacks this stop")
    for node, name in doctor.names.items():
        subject = doctor.subjects.get(node)
        if subject is None or not subject.identity.table:
            continue
        axis, driver = machine.axes[name], doctor.bus.driver.axis(subject.identity)
        subject.found.clear()
        _check_fit(subject, axis, driver)
        _check_ends(subject, axis, doctor.bus.family.link.stops)
        if not axis.is_wheel and "position" in driver:
            _check_limits(doctor, subject, axis, driver)
        doctor.found += subject.found
    joints = {name.removeprefix(f"{bus}_"): node for node, name in doctor.names.items()}
    offsets = _read_offsets(doctor)
    _check_owner(doctor, {joint: offsets[node] for joint, node in joints.items() if node in offsets})


def _check_fit(subject: Subject, axis: AxisConfig, driver: AxisDriver) -> None:
    """The axis needs what the model or its mode lacks."""
    model, mode = subject.identity.model, subject.identity.details.get("mode", "position")
    if axis.is_wheel and not {"set_velocity", "jog"} & driver.names:
        subject.add("mode-differs", f"mode {mode}, the axis is a wheel, which needs velocity")
    elif not axis.is_wheel and "position" in driver and "stream" not in driver:
        subject.add("mode-differs", f"mode {mode}, the axis has positions, which need position")
    if axis.max_torque is not None and "cap_torque" not in driver:
        subject.add("axis-mismatch", f"max_torque = {axis.max_torque:g}, {model} has no torque limit")
    if axis.exit_action == "torque_off" and "disable_torque" not in driver:
        subject.add("axis-mismatch", f'exit = "torque_off", {model} has no torque switch')


def _check_ends(subject: Subject, axis: AxisConfig, stops: tuple[str, ...]) -> None:
    if axis.exit_action == "torque_off":
        subject.add("exit-falls", 'exit = "torque_off": limp at the end of a program')
    if (axis.estop or (stops[0] if stops else "")) == "torque_off":
        subject.add("estop-falls", "an emergency stop switches torque off")


def _check_limits(doctor: BusDoctor, subject: Subject, axis: AxisConfig, driver: AxisDriver) -> None:
    """The limits of the file against those of the device, and against where it is."""
    low, high = axis.device_limits
    limits: Any = doctor.read(driver.limits(subject.device)) if "limits" in driver else None
    here = doctor.read(driver.position(subject.device))
    if not isfinite(low) or isinstance(here, MotorbusError):
        return
    if isinstance(limits, tuple) and degrees(max(limits[0] - low, high - limits[1])) > SLACK:
        allowed, possible = ([f"{degrees(one):.1f}" for one in pair] for pair in ((low, high), limits))
        evidence = (
            f"device angles in the file {' to '.join(allowed)} deg, in the device {' to '.join(possible)} deg"
        )
        subject.add("calibration-differs", evidence)
    elif degrees(max(low - here, here - high)) > OUTSIDE:
        ends = f"{axis.show(axis.low or 0.0)} to {axis.show(axis.high or 0.0)}"
        subject.add("outside-limits", f"at {axis.show(axis.from_device(here))}, limits {ends}")


# -- saved calibrations of LeRobot -----------------------------------------------------------------------------


def saved_calibrations() -> dict[str, dict[str, JointCalibration]]:
    """The calibrations that LeRobot has saved on this computer, by folder and name, as so_follower/blue."""
    home = os.environ.get("HF_LEROBOT_HOME") or "~/.cache/huggingface/lerobot"
    root = Path(os.environ.get("HF_LEROBOT_CALIBRATION") or f"{home}/calibration").expanduser()
    found = {}
    for path in sorted(root.glob("*/*/*.json")):
        try:
            found[f"{path.parent.name}/{path.stem}"] = lerobot.load(path)
        except RequestError:
            continue  # of a robot of another kind
    return found


def _read_offsets(doctor: BusDoctor) -> dict[int, int]:
    """The homing offsets (counts) of the devices that have one, by id."""
    offsets = {}
    for node, subject in doctor.subjects.items():
        if "homing_offset" in doctor.bus.family.registers.get(subject.identity.table, {}):
            raw = doctor.read(type(subject.device).read_raw.function(subject.device, "homing_offset"))
            if not isinstance(raw, MotorbusError):
                offsets[node] = raw["homing_offset"]
    return offsets


def check_saved(doctor: BusDoctor) -> None:
    """A bus without a machine file: devices that differ from the saved calibration that fits most of them."""
    saved = saved_calibrations()
    offsets = _read_offsets(doctor) if saved else {}
    candidates = []
    for name, calibration in saved.items():
        if offsets.keys() == {one.id for one in calibration.values()}:
            own = {joint: offsets[one.id] for joint, one in calibration.items()}
            candidates.append((name, calibration, lerobot.differences(own, calibration)))
    if not candidates:
        return
    name, calibration, differing = min(candidates, key=lambda one: len(one[2]))
    for joint, (found, wanted) in differing.items() if 2 * len(differing) < len(offsets) else ():
        evidence = f"homing offset of {joint} {found}, saved {wanted} in {name}"
        doctor.add("calibration-other", doctor.name(calibration[joint].id), evidence)


def _check_owner(doctor: BusDoctor, offsets: Mapping[str, int]) -> None:
    """Homing offsets by joint belong to another saved calibration than the one with the name of the bus."""
    saved = saved_calibrations() if offsets else {}
    own = [
        lerobot.differences(offsets, calibration)
        for name, calibration in saved.items()
        if name.endswith(f"/{doctor.where}") and calibration.keys() & offsets.keys()
    ]
    if not own or not all(own):
        return
    shown = ", ".join(
        f"{joint} {found}, saved {wanted}" for joint, (found, wanted) in min(own, key=len).items()
    )
    owner = lerobot.owner(offsets, saved)
    cause, fix = (f"they are those of {owner}", "swap the ports of the two arms") if owner else ("", "")
    doctor.add("calibration-other", doctor.where, f"homing offsets: {shown}", cause, fix)
