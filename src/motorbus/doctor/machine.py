"""What the machine file says of the devices of a bus, against what they say of themselves. Reads only."""

from __future__ import annotations

import os
from collections.abc import Mapping
from math import degrees, isfinite
from pathlib import Path
from typing import Any, Final

from motorbus.core.family import AxisDriver
from motorbus.core.findings import Finding, Severity, Subject
from motorbus.core.steps import catch
from motorbus.doctor.bus import BusDoctor
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.machine import AxisConfig, MachineConfig
from motorbus.motion.opening import bus_options
from motorbus.session.journals import unfinished
from motorbus.setup import lerobot
from motorbus.setup.calibrate import JointCalibration

SLACK: Final = 1.0  # deg by which limits may differ
OUTSIDE: Final = 3.0  # deg outside its limits that a limp joint may rest # assumption
FOLDERS: Final = ("robots", "teleoperators")


def check_journal(doctor: BusDoctor) -> None:
    """An unfinished guarded change of this bus."""
    change = unfinished(doctor.bus)
    if change is not None:
        node = change.facts.get("node")
        where = doctor.name(node) if isinstance(node, int) else doctor.where
        evidence = f"unfinished: {change.what or change.verb}"
        cause = "the program or the supply ended while it changed the device"
        fix = f"`motorbus recover {doctor.where}`"
        _add(doctor, "error", "change-unfinished", where, evidence, cause, fix)


def check_axes(doctor: BusDoctor, machine: MachineConfig, bus: str) -> None:
    """The axes of this bus whose devices answer."""
    try:
        bus_options(machine, bus)
    except RequestError as error:
        fix = f"write estop as {error.expected}, or leave it out"
        _add(doctor, "error", "axis-mismatch", bus, error.summary, "the family lacks this stop", fix)
    offsets: dict[str, int] = {}
    for name, axis in machine.axes.items():
        subject = doctor.subjects.get(axis.node)
        if axis.bus != bus or subject is None or not subject.identity.table:
            continue
        subject.found.clear()
        driver = doctor.bus.driver.axis(subject.identity)
        _check_fit(subject, axis, driver)
        _check_ends(subject, axis, doctor)
        if not axis.is_wheel and "position" in driver:
            _check_limits(subject, axis, driver, doctor)
        doctor.found += subject.found
        offset = _homing_offset(doctor, subject)
        if offset is not None:
            offsets[name] = offset
    _check_owner(doctor, bus, offsets)


def _add(doctor: BusDoctor, severity: Severity, code: str, where: str, *texts: str) -> None:
    doctor.found.append(Finding(code, severity, where, *texts))


def _check_fit(subject: Subject, axis: AxisConfig, driver: AxisDriver) -> None:
    """The axis needs what the model or its mode lacks."""
    model, cause = subject.identity.model, "the file was made for another model"
    mode = str(subject.identity.details.get("mode", ""))
    if axis.is_wheel and not {"set_velocity", "jog"} & driver.names:
        fix = f"`motorbus {_family(subject)} mode {subject.where} velocity`"
        subject.error(
            "mode-differs",
            f"mode {mode or 'position'}, the axis is a wheel",
            "a wheel turns by velocity",
            fix,
        )
    elif not axis.is_wheel and "position" in driver and "stream" not in driver:
        fix = f'`motorbus {_family(subject)} mode {subject.where} position`, or kind = "wheel"'
        subject.error(
            "mode-differs", f"mode {mode}, the axis has positions", "it ignores goal positions", fix
        )
    if axis.max_torque is not None and "cap_torque" not in driver:
        evidence = f"max_torque = {axis.max_torque:g}, {model} has no torque limit"
        subject.error("axis-mismatch", evidence, cause, "take max_torque out of the axis")
    if axis.exit_action == "torque_off" and "disable_torque" not in driver:
        evidence = f'exit = "torque_off", {model} has no torque switch'
        subject.error("axis-mismatch", evidence, cause, 'write exit = "hold"')


def _family(subject: Subject) -> str:
    return str(subject.device.bus.family.name)


def _check_ends(subject: Subject, axis: AxisConfig, doctor: BusDoctor) -> None:
    stops = doctor.bus.family.link.stops
    if axis.exit_action == "torque_off":
        cause = "a joint that carries weight falls"
        subject.inform(
            "exit-falls", 'exit = "torque_off": limp at the end of a program', cause, 'exit = "park"'
        )
    if (axis.estop or (stops[0] if stops else "")) == "torque_off":
        cause = "a joint that carries weight falls"
        fix = 'estop = "hold" where that is safe'
        subject.inform("estop-falls", "an emergency stop switches torque off", cause, fix)


def _check_limits(subject: Subject, axis: AxisConfig, driver: AxisDriver, doctor: BusDoctor) -> None:
    low, high = axis.device_limits
    found = doctor.bus.run(catch(driver.limits(subject.device))) if "limits" in driver else None
    here = doctor.bus.run(catch(driver.position(subject.device)))
    if isinstance(found, tuple) and isfinite(low):
        first, last = found
        if degrees(first - low) > SLACK or degrees(high - last) > SLACK:
            evidence = (
                f"the file allows {degrees(low):.1f} to {degrees(high):.1f} deg of the device,"
                f" the device {degrees(first):.1f} to {degrees(last):.1f} deg"
            )
            cause = "the device was calibrated again, or replaced, after the file was written"
            fix = "`motorbus setup calibrate`, or correct zero, low and high"
            subject.error("calibration-differs", evidence, cause, fix)
            return
    if isinstance(here, MotorbusError):
        return
    outside = max(low - here, here - high)
    if isfinite(outside) and degrees(outside) > OUTSIDE:
        position = axis.from_device(here)
        evidence = (
            f"at {axis.show(position)}, limits {axis.show(axis.low or 0)} to {axis.show(axis.high or 0)}"
        )
        cause = "it was moved by hand, or its zero is of another calibration"
        fix = "move it inside by hand, or `motorbus setup calibrate`"
        subject.warn("outside-limits", evidence, cause, fix)


# -- saved calibrations of LeRobot -----------------------------------------------------------------------------


def _homing_offset(doctor: BusDoctor, subject: Subject) -> int | None:
    table: Mapping[str, Any] = doctor.bus.family.registers.get(subject.identity.table, {})
    if "homing_offset" not in table:
        return None
    try:
        return int(subject.device.read_raw("homing_offset")["homing_offset"])
    except MotorbusError:
        return None


def saved_calibrations() -> dict[str, dict[str, JointCalibration]]:
    """The calibrations that LeRobot has saved on this computer, by folder and name, as so_follower/blue."""
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    home = os.environ.get("HF_LEROBOT_HOME") or f"{cache}/huggingface/lerobot"
    root = Path(os.environ.get("HF_LEROBOT_CALIBRATION") or f"{home}/calibration").expanduser()
    found = {}
    for path in sorted(one for kind in FOLDERS for one in (root / kind).glob("*/*.json")):
        try:
            found[f"{path.parent.name}/{path.stem}"] = lerobot.load(path)
        except RequestError:
            continue  # of a robot of another kind
    return found


def _check_owner(doctor: BusDoctor, bus: str, offsets: Mapping[str, int]) -> None:
    """The homing offsets of an arm belong to another saved calibration than the one with its name."""
    saved = saved_calibrations() if offsets else {}
    joints = {name.removeprefix(f"{bus}_"): offset for name, offset in offsets.items()}
    own = [name for name in saved if name.partition("/")[2] == bus]
    if not own or not any(saved[name].keys() & joints.keys() for name in own):
        return
    differences: dict[str, Any] = min((lerobot.differences(joints, saved[name]) for name in own), key=len)
    if not differences:
        return
    shown = ", ".join(f"{joint} {found}, saved {wanted}" for joint, (found, wanted) in differences.items())
    owner = lerobot.owner(joints, saved)
    cause = f"they are those of {owner}" if owner else "it was calibrated again, or a servo was replaced"
    fix = (
        "swap the ports of the two arms" if owner else "`motorbus setup export` saves the present calibration"
    )
    _add(doctor, "error", "calibration-other", bus, f"homing offsets: {shown}", cause, fix)
