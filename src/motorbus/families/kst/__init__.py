"""KST CAN servos, and the makers that share their protocol: an expedited subset of CANopen SDO.

`Servo` and `AsyncServo` are one servo each; the functions serve a whole bus. No servo reports its maker, so a bus is
opened with a profile (`kst:PORT,profile=xqpower`).
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import DeviceTypes, Family, LinkSpec, Option
from motorbus.families.kst.driver.broadcast import broadcast_write
from motorbus.families.kst.driver.bus import KstDriver
from motorbus.families.kst.driver.feedback import RawStatus, Status
from motorbus.families.kst.driver.motion import Promise
from motorbus.families.kst.driver.node import ID_FORMATS, NMT, SIZED, BusSettings
from motorbus.families.kst.driver.provisioning import PowerCycleNeeded, Provisioned
from motorbus.families.kst.driver.scan import ScanWarning, scan
from motorbus.families.kst.driver.servo import AsyncServo, Servo, settings_of
from motorbus.families.kst.profiles import DEFAULT_RATE, PROFILES, RATES, TABLES

__all__ = [
    "FAMILY",
    "AsyncServo",
    "BusSettings",
    "KstDriver",
    "PowerCycleNeeded",
    "Promise",
    "Provisioned",
    "RawStatus",
    "ScanWarning",
    "Servo",
    "Status",
    "broadcast_write",
    "scan",
    "settings_of",
]

_SETTINGS: Final = (
    Option("profile", str, "kst", "the make of the servos; no servo reports it", tuple(PROFILES)),
    Option("id_format", str, "std", "identifiers of 11 bits (std) or 29 (ext)", ID_FORMATS),
    Option("sized", str, "no", "whether writes state their length", SIZED),
    Option(
        "nmt", str, "profile", "start before a move: by the profile, none, or standard (NMT of CiA 301)", NMT
    ),
)

_COMMANDS: Final = (
    "position", "move", "version", "node_id", "set_node_id", "set_bit_rate", "save", "set_mid_point", "set_reversed",
)  # fmt: skip

FAMILY: Final = Family(
    name="kst",
    link=LinkSpec("frames", DEFAULT_RATE, RATES, _SETTINGS, stops=("hold",)),
    registers=TABLES,
    devices=DeviceTypes(Servo, AsyncServo),
    driver=KstDriver,
    simulator_module="motorbus.families.kst.simulator",
    checks_module="motorbus.families.kst.checks",
    commands={name: getattr(Servo, name).function for name in _COMMANDS},
)
