"""FEETECH SCS, SMS, STS and HLS servos on a half-duplex serial bus: all six register maps.

`Servo` and `AsyncServo` are one servo each, `ServoGroup` is several in a loop; the functions serve several at once.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import DeviceTypes, Family, LinkSpec, Option, Positions
from motorbus.core.scan import Skipped
from motorbus.families.feetech.driver.access import action_all
from motorbus.families.feetech.driver.bus import FeetechDriver
from motorbus.families.feetech.driver.calibration import Calibration, Zero
from motorbus.families.feetech.driver.group import (
    GroupResult,
    ReadsAlone,
    ServoGroup,
    disable_torque_all,
    prepare_all,
    reg_write_all,
    sync_read,
    sync_write,
)
from motorbus.families.feetech.driver.identity import ScanWarning, scan
from motorbus.families.feetech.driver.maintenance import Recovery
from motorbus.families.feetech.driver.motion import Promise
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.servo import AsyncServo, Servo
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.codes import BAUD_CODES

__all__ = [
    "FAMILY",
    "AsyncServo",
    "Calibration",
    "FeetechDriver",
    "GroupResult",
    "Node",
    "Positions",
    "Promise",
    "ReadsAlone",
    "Recovery",
    "ScanWarning",
    "Servo",
    "ServoGroup",
    "Skipped",
    "Zero",
    "action_all",
    "disable_torque_all",
    "prepare_all",
    "reg_write_all",
    "scan",
    "sync_read",
    "sync_write",
]

_SETTINGS: Final = (
    Option("estop_hold", str, "", "ids that an emergency stop holds instead of switching torque off, as 1+4"),
    Option("arc", str, "", "degrees of all counts of SCS servos by id, as 3:180+4:180; else by the model"),
    Option("map", str, "", "register map by which bytes of unknown servos are explained", ("", *TABLES)),
)

_COMMANDS: Final = ("ping", "read", "write", "reg_write", "action", "clear_turns", "factory_restore")

FAMILY: Final = Family(
    name="feetech",
    link=LinkSpec(
        "bytes", BAUD_CODES[0], tuple(BAUD_CODES.values()), _SETTINGS, stops=("torque_off", "hold")
    ),
    registers=TABLES,
    devices=DeviceTypes(Servo, AsyncServo),
    driver=FeetechDriver,
    simulator_module="motorbus.families.feetech.simulator",
    checks_module="motorbus.families.feetech.checks",
    recording_module="motorbus.families.feetech.decode",
    commands={name: getattr(Servo, name).function for name in _COMMANDS},
    sync_write=sync_write,
    sync_read=sync_read,
)
