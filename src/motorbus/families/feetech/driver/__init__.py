"""What to say to FEETECH servos to get a thing done: one function for each, none of which sends anything itself.

Functions of one servo take a `Node` (a `Servo` is one), functions of several take nodes or plain ids. Each returns
an `Exchange`, or an operation that yields exchanges; a bus carries it out.
"""

from __future__ import annotations

from motorbus.families.feetech.driver.feedback import (
    current,
    load,
    position,
    telemetry,
    temperature,
    velocity,
    voltage,
)
from motorbus.families.feetech.driver.group import GroupResult, prepare_all, sync_read, sync_write
from motorbus.families.feetech.driver.identity import identify, ping, prepare
from motorbus.families.feetech.driver.loop import Positions, sync_read_positions, sync_write_positions
from motorbus.families.feetech.driver.motion import Promise, enable_torque, move, stop
from motorbus.families.feetech.driver.node import COMMANDED, Node, Settings
from motorbus.families.feetech.driver.registers import action, action_all, read, read_raw, reg_write, write
from motorbus.families.feetech.driver.restoring import factory_restore
from motorbus.families.feetech.driver.scanning import scan
from motorbus.families.feetech.driver.servo import AsyncServo, Servo, ServoVerbs
from motorbus.families.feetech.driver.torque import disable_torque, disable_torque_all

__all__ = [
    "COMMANDED",
    "AsyncServo",
    "GroupResult",
    "Node",
    "Positions",
    "Promise",
    "Servo",
    "ServoVerbs",
    "Settings",
    "action",
    "action_all",
    "current",
    "disable_torque",
    "disable_torque_all",
    "enable_torque",
    "factory_restore",
    "identify",
    "load",
    "move",
    "ping",
    "position",
    "prepare",
    "prepare_all",
    "read",
    "read_raw",
    "reg_write",
    "scan",
    "stop",
    "sync_read",
    "sync_read_positions",
    "sync_write",
    "sync_write_positions",
    "telemetry",
    "temperature",
    "velocity",
    "voltage",
    "write",
]
