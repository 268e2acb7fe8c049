"""Set up a FEETECH bus of an open robot: number its servos, calibrate its joints, verify them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from msgspec import structs

from motorbus.errors import RequestError
from motorbus.motion.machine import AxisConfig
from motorbus.motion.opening import UNTRUSTED
from motorbus.motion.robot import Robot
from motorbus.setup import machine, presets
from motorbus.setup.calibrate import measure, write
from motorbus.setup.engine import Note, Steps
from motorbus.setup.number import number as number_servos
from motorbus.setup.number import present
from motorbus.setup.presets import Joint, Preset
from motorbus.setup.verify import verify as verify_joints

RISES: Final = "move it by hand in the direction in which its position shall rise"
NEW: Final = f"{UNTRUSTED}its servo was silent, calibrate it or open the machine again"
STALE: Final = f"{UNTRUSTED}its calibration, open the machine again"


def preset_of(robot: Robot, bus: str, names: Sequence[str]) -> Preset:
    """These joints of a bus, () means all: its axes with a position; of a bus without an axis those of an SO-101.

    Raises RequestError for an unknown name and for a bus that is not one of FEETECH servos.
    """
    if bus not in robot.buses or robot.buses[bus].family.name != "feetech":
        raise RequestError(f"{bus}: it cannot be set up by hand", expected="a bus of FEETECH servos")
    arm = structs.replace(presets.preset("so101"), rate=robot.buses[bus].rate)
    if axes := _axes(robot, bus):
        known = {machine.axis_name(bus, joint.name): joint for joint in arm.joints}
        joints = [
            structs.replace(known.get(name, Joint(name, 0, RISES)), name=name, id=config.node)
            for name, config in axes.items()
        ]
        settings = arm.settings if axes.keys() & known.keys() else {}
        arm = structs.replace(arm, name=bus, joints=tuple(joints), settings=settings)
    chosen = [arm.joint(name) for name in names]
    return structs.replace(arm, joints=tuple(chosen)) if chosen else arm


def number(robot: Robot, bus: str, names: Sequence[str]) -> Steps[bool]:
    """Give servos their ids. All axes of the bus go limp; those that were silent must be calibrated."""
    preset = preset_of(robot, bus, names)
    axes = _release(robot, bus)
    before = present(robot.buses[bus], preset)
    try:
        yield from number_servos(robot.buses[bus], preset)
    finally:
        for name, axis in axes.items():
            if axis.node not in before:
                robot.axes[name].status.set_fault(NEW)
    return False


def calibrate(robot: Robot, bus: str, names: Sequence[str]) -> Steps[bool]:
    """Sweep joints by hand, write servos and machine file; then the machine must be opened again.

    All axes of the bus are at fault until then. Raises RequestError without a file, and for a gear.
    """
    preset = preset_of(robot, bus, names)
    if not robot.config.path:
        raise RequestError("a calibration needs a machine file", advice="`motorbus init BUS` writes one")
    for name, config in _axes(robot, bus).items():
        if abs(config.ratio) != 1:
            raise RequestError(f"{name}: a joint with a gear cannot be calibrated by hand")
    axes = _release(robot, bus)
    path = Path(robot.config.path)
    found = yield from measure(robot.buses[bus], preset)
    signed = {
        name: structs.replace(one, drive_mode=int(name in axes and axes[name].sign < 0))
        for name, one in found.items()
    }
    text = machine.recalibrated(path, preset, signed) if axes else ""
    for name in axes:
        robot.axes[name].status.set_fault(STALE)
    yield from write(robot.buses[bus], found)
    if axes:
        path.write_text(text, "utf-8")
    else:
        machine.update(path, preset, found, address=robot.config.buses[bus].address, arm=bus)
    yield Note(f"{', '.join(found)}: written to {path.name}")
    return True


def verify(robot: Robot, bus: str, names: Sequence[str]) -> Steps[bool]:
    """Compare names and directions with joints that are moved by hand; only reads are sent. All axes go limp."""
    preset = preset_of(robot, bus, names)
    axes = _release(robot, bus)
    signs = yield from verify_joints(robot.buses[bus], preset)
    for name, sign in signs.items():
        if name in axes and sign != axes[name].sign:
            text = f"{name} turns the other way: its machine file needs sign = {sign}"
            yield Note(text, warning=True)
    return False


PROCEDURES: Final = {"number": number, "calibrate": calibrate, "verify": verify}
"""Each gives True if the machine must be opened again."""


def _axes(robot: Robot, bus: str) -> dict[str, AxisConfig]:
    axes = {name: axis.config for name, axis in robot.axes.items()}
    return {name: one for name, one in axes.items() if one.bus == bus and not one.is_wheel}


def _release(robot: Robot, bus: str) -> dict[str, AxisConfig]:
    axes = _axes(robot, bus)
    if axes:
        robot.disable_torque(tuple(axes))
    return axes
