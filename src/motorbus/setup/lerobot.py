"""Calibration files of LeRobot, and the axes of a machine file that mean the same.

LeRobot divides a turn by 4095 counts, a servo by 4096: a machine file has the angles of the servo, so both name the
same count.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import msgspec

from motorbus.errors import RequestError
from motorbus.setup.calibrate import TURN, JointCalibration, check

STEPS: Final = TURN - 1  # of a turn, as LeRobot counts
TOLERANCE: Final = 2  # counts between two homing offsets that are the same


def parse(text: str | bytes, name: str = "calibration") -> dict[str, JointCalibration]:
    """The joints of a calibration file. Raises RequestError that names the joint."""
    try:
        found = msgspec.json.decode(text, type=dict[str, JointCalibration])
    except msgspec.DecodeError as error:
        raise RequestError(
            f"{name}: {error}",
            expected='{"shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": …, "range_min": …, "range_max": …}}',
        ) from None
    for joint, one in found.items():
        check(one, f"{name}: {joint}")
        if one.drive_mode not in (0, 1):
            raise RequestError(f"{name}: {joint} has drive_mode {one.drive_mode}", expected="0 or 1")
    return found


def load(path: str | Path) -> dict[str, JointCalibration]:
    """The joints of a calibration file. Raises RequestError."""
    try:
        return parse(Path(path).read_bytes(), str(path))
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}") from None


def dump(calibration: Mapping[str, JointCalibration]) -> str:
    """The text of a calibration file, as LeRobot writes it."""
    return msgspec.json.format(msgspec.json.encode(calibration), indent=4).decode()


# -- which arm is it -------------------------------------------------------------------------------------------


def differences(
    offsets: Mapping[str, int], calibration: Mapping[str, JointCalibration]
) -> dict[str, tuple[int, int]]:
    """The joints whose homing offset is another one than in this calibration: (in the servo, in the file)."""
    return {
        joint: (offsets[joint], one.homing_offset)
        for joint, one in calibration.items()
        if joint in offsets and abs(offsets[joint] - one.homing_offset) > TOLERANCE
    }


def owner(offsets: Mapping[str, int], others: Mapping[str, Mapping[str, JointCalibration]]) -> str:
    """The name of the one calibration that fits all these homing offsets; "" for none or several."""
    names = [
        name
        for name, calibration in others.items()
        if calibration.keys() == offsets.keys() and not differences(offsets, calibration)
    ]
    return names[0] if len(names) == 1 else ""
