"""`motorbus setup`: from new servos to a machine file, step by step."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, Parameter
from msgspec import Struct

from motorbus import session
from motorbus.bus.blocking import Bus
from motorbus.cli.common import Common, Writing
from motorbus.cli.output import confirm, emit
from motorbus.cli.target import bus_address, load_machine
from motorbus.errors import NoReply, RequestError
from motorbus.families import feetech
from motorbus.link.serial import ports
from motorbus.setup import lerobot, machine, presets
from motorbus.setup.calibrate import JointCalibration, apply, read_calibration
from motorbus.setup.calibrate import calibrate as sweep
from motorbus.setup.engine import run
from motorbus.setup.number import number as number_servos
from motorbus.setup.number import present
from motorbus.setup.port import find_port
from motorbus.setup.presets import Preset
from motorbus.setup.replace import replace as replace_servo
from motorbus.setup.terminal import Terminal
from motorbus.setup.verify import verify as verify_joints

app = App(name="setup", help="Set up an arm step by step.")

UNSET: Final = (0, 0, 4095)  # offset and limits of a servo that was never calibrated


@Parameter(name="*")
@dataclass
class Arm:
    """Which arm."""

    preset: Annotated[str, Parameter(help="so101 or so100.")] = "so101"
    port: Annotated[str, Parameter(help="Port of the arm; without it the arm is swung by hand.")] = ""
    arm: Annotated[str, Parameter(help="Name of its bus, and in front of its axes.")] = "arm"


class ArmReady(Struct, frozen=True, tag="setup"):
    """What was set up: the address of the arm, its axes, and the file that names them."""

    arm: str
    address: str
    joints: tuple[str, ...]
    file: str = ""


@app.default
def setup(*, arm: Arm = Arm(), common: Common = Common()) -> None:
    """Number the servos that have no id yet, calibrate the joints, verify them, write the machine file.

    Examples:

        motorbus setup
        motorbus setup --preset so101 --port /dev/ttyACM0
        motorbus setup --arm leader --port /dev/ttyACM1

    It may be interrupted at every question: run it again, it continues with what is left.
    """
    preset = presets.preset(arm.preset)
    with _open_arm(arm, preset, common) as (bus, address, face):
        run(number_servos(bus, preset), face)
        _check_present(bus, preset)
        found = {joint.name: read_calibration(bus, joint) for joint in preset.joints}
        swept = [found[joint.name] for joint in preset.joints if not joint.full_turn]
        if any((one.homing_offset, one.range_min, one.range_max) == UNSET for one in swept):
            found = run(sweep(bus, preset), face)
        signs = run(verify_joints(bus, preset), face)
        _write(common, preset, _with_signs(found, signs), address, arm)


@app.command
def number(*, arm: Arm = Arm(), common: Common = Common()) -> None:
    """Give each servo its id, one at a time.

    Examples:

        motorbus setup number --port /dev/ttyACM0
        motorbus setup number --preset so100 --port /dev/ttyACM0
    """
    preset = presets.preset(arm.preset)
    with _open_arm(arm, preset, common) as (bus, address, face):
        run(number_servos(bus, preset), face)
    emit(ArmReady(arm.arm, address, tuple(joint.name for joint in preset.joints)), common)


@app.command
def calibrate(*joints: str, arm: Arm = Arm(), common: Common = Common()) -> None:
    """Sweep joints by hand; write offsets and limits (EEPROM).

    Examples:

        motorbus setup calibrate --port /dev/ttyACM0
        motorbus setup calibrate gripper wrist_roll
    """
    preset = presets.preset(arm.preset)
    with _open_arm(arm, preset, common) as (bus, address, face):
        _write(common, preset, run(sweep(bus, preset, joints), face), address, arm)


@app.command
def verify(*, arm: Arm = Arm(), common: Common = Common()) -> None:
    """Check names and directions by moving each joint by hand.

    Examples:

        motorbus setup verify --port /dev/ttyACM0
    """
    preset = presets.preset(arm.preset)
    with _open_arm(arm, preset, common) as (bus, address, face):
        found = {joint.name: read_calibration(bus, joint) for joint in preset.joints}
        signs = run(verify_joints(bus, preset), face)
        moved = {name: one for name, one in found.items() if name in signs}
        _write(common, preset, _with_signs(moved, signs), address, arm)


@app.command(name="import")
def import_(
    file: Path, /, *, arm: Arm = Arm(), writing: Writing = Writing(), common: Common = Common()
) -> None:
    """Write a calibration of LeRobot to the servos (EEPROM).

    Examples:

        motorbus setup import follower.json --port /dev/ttyACM0
        motorbus setup import leader.json --arm leader --yes
    """
    preset = presets.preset(arm.preset)
    wanted = lerobot.load(file)
    with _open_arm(arm, preset, common) as (bus, address, _):
        found = {name: read_calibration(bus, preset.joint(name)) for name in wanted}
        changed = {
            name: one
            for name, one in wanted.items()
            if (one.homing_offset, one.range_min, one.range_max)
            != (found[name].homing_offset, found[name].range_min, found[name].range_max)
        }
        if changed:
            confirm(f"write offsets and limits of {', '.join(changed)}; they go limp", writing)
        for one in changed.values():
            apply(bus, one)
        _write(common, preset, wanted, address, arm)


@app.command
def export(file: Path, /, *, arm: Arm = Arm(), common: Common = Common()) -> None:
    """Save the calibration of the servos for LeRobot.

    Examples:

        motorbus setup export follower.json --port /dev/ttyACM0
    """
    preset = presets.preset(arm.preset)
    with _open_arm(arm, preset, common) as (bus, address, _):
        found = {joint.name: read_calibration(bus, joint) for joint in preset.joints}
    if (known := load_machine(common)) is not None:
        found = machine.calibration_of(known, preset, found, arm.arm)
    with file.open("x", encoding="utf-8") as stream:
        stream.write(lerobot.dump(found))
    emit(ArmReady(arm.arm, address, tuple(found), str(file)), common)


@app.command
def replace(
    joint: str, backup: Path | None = None, /, *, arm: Arm = Arm(), common: Common = Common()
) -> None:
    """Put a fresh servo in the place of a dead one.

    Examples:

        motorbus setup replace elbow_flex --port /dev/ttyACM0
        motorbus setup replace elbow_flex elbow.json --port /dev/ttyACM0
    """
    preset = presets.preset(arm.preset)
    settings = _settings(backup) if backup is not None else {}
    with _open_arm(arm, preset, common) as (bus, address, face):
        found = run(replace_servo(bus, preset, joint, settings), face)
        _write(common, preset, {joint: found}, address, arm)


# -- shared ----------------------------------------------------------------------------------------------------


@contextmanager
def _open_arm(arm: Arm, preset: Preset, common: Common) -> Iterator[tuple[Bus, str, Terminal]]:
    """The open bus of an arm, its address, and the terminal."""
    face = Terminal()
    known = load_machine(common)
    if arm.port:
        address = arm.port if ":" in arm.port else f"feetech:{arm.port}"
    elif common.bus or (known is not None and arm.arm in known.buses):
        address = bus_address(common.bus or arm.arm, common)
    else:
        address = f"feetech:{run(find_port([one.device for one in ports()], preset), face)}"
    if not address.startswith("feetech:"):
        raise RequestError(f"{address}: {preset.name} has feetech servos", expected="feetech:PORT")
    with session.open(address) as bus:
        yield bus, address, face


def _check_present(bus: Bus, preset: Preset) -> None:
    missing = {joint.id: joint.name for joint in preset.joints if joint.id not in present(bus, preset)}
    if missing:
        names = ", ".join(f"{name} (id {id})" for id, name in missing.items())
        raise NoReply(f"{names}: no reply", advice="connect all servos and run it again")


def _with_signs(
    found: Mapping[str, JointCalibration], signs: Mapping[str, int]
) -> dict[str, JointCalibration]:
    return {
        name: JointCalibration(
            one.id, int(signs.get(name, 1) < 0), one.homing_offset, one.range_min, one.range_max
        )
        for name, one in found.items()
    }


def _write(
    common: Common, preset: Preset, found: Mapping[str, JointCalibration], address: str, arm: Arm
) -> None:
    path = Path(common.machine)
    machine.update(path, preset, found, address=address, arm=arm.arm)
    emit(ArmReady(arm.arm, address, tuple(found), str(path)), common)


def _settings(path: Path) -> dict[str, float]:
    """The settings of a file of `motorbus backup`, in API units. Raises RequestError."""
    try:
        data = json.loads(path.read_text("utf-8"))
        table = feetech.FAMILY.registers[data["map"]]
        return {name: float(table[name].to_value(int(raw))) for name, raw in data["values"].items()}
    except (OSError, ValueError, KeyError, TypeError):
        raise RequestError(f"{path} is not a file of `motorbus backup` of a feetech servo") from None
