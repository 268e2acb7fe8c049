"""Put a fresh servo in the place of a dead one: its id, the settings of a backup, a calibration of this joint."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from motorbus.bus.blocking import Bus
from motorbus.errors import RequestError
from motorbus.families import feetech
from motorbus.setup.calibrate import JointCalibration, calibrate
from motorbus.setup.engine import Note, Steps
from motorbus.setup.number import number_one
from motorbus.setup.presets import Preset

OF_THE_SERVO: Final = (
    "id",
    "baud_rate",
    "homing_offset",
    "min_position_limit",
    "max_position_limit",
    "phase",
    "max_voltage",
    "min_voltage",
)
"""Settings that belong to one servo, or to its mounting."""


def replace(bus: Bus, preset: Preset, name: str, settings: Mapping[str, float]) -> Steps[JointCalibration]:
    """Number the fresh servo of this joint, write `settings` (API units, of a backup), and calibrate the joint.

    The settings of its id, rate, offset, limits, phase and supply are left out. Raises RequestError if it is skipped.
    """
    joint = preset.joint(name)
    if not (yield from number_one(bus, preset, joint)):
        raise RequestError(f"{name} was not replaced: no servo was numbered")
    kept: dict[str, Any] = {key: value for key, value in settings.items() if key not in OF_THE_SERVO}
    if kept:
        feetech.Servo(bus, joint.id).write(**kept)
        yield Note(f"{name}: {len(kept)} settings of the backup are written")
    found = yield from calibrate(bus, preset, (name,))
    return found[name]
