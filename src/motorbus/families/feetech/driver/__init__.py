"""What to say to FEETECH servos to get a thing done: one function for each, none of which sends anything itself.

Functions of one servo take a `Node` (a `Servo` is one), functions of several take nodes or plain ids. Each returns
a `Request`, or is a procedure that awaits steps; a bus carries it out.
"""

from __future__ import annotations

from motorbus.core.family import Positions
from motorbus.families.feetech.driver.alarm import alarms
from motorbus.families.feetech.driver.at_once import reg_write_all
from motorbus.families.feetech.driver.blocked import blockers
from motorbus.families.feetech.driver.bound import Powerless
from motorbus.families.feetech.driver.calibration import Calibration, Zero, calibrate, zero
from motorbus.families.feetech.driver.capping import cap_current, cap_torque
from motorbus.families.feetech.driver.copying import copyable
from motorbus.families.feetech.driver.counting import ManyTurns, Recounted, many_turns, set_many_turns
from motorbus.families.feetech.driver.drive import set_current, set_duty, set_velocity, step
from motorbus.families.feetech.driver.eeprom import TorqueAfterWrite
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
from motorbus.families.feetech.driver.health import health
from motorbus.families.feetech.driver.identity import identify, ping, prepare
from motorbus.families.feetech.driver.loop import (
    position_reads,
    read_positions,
    sync_read_positions,
    sync_write_positions,
)
from motorbus.families.feetech.driver.modes import mode, set_mode
from motorbus.families.feetech.driver.motion import Promise, enable_torque, move, stop
from motorbus.families.feetech.driver.node import Node, Settings
from motorbus.families.feetech.driver.overload import Recovery, recover_overload
from motorbus.families.feetech.driver.rates import set_baud
from motorbus.families.feetech.driver.recovery import recover
from motorbus.families.feetech.driver.registers import (
    action,
    action_all,
    read,
    read_raw,
    reg_write,
    rewrite,
    torque_after_write,
    write,
)
from motorbus.families.feetech.driver.renaming import set_id
from motorbus.families.feetech.driver.restoring import factory_restore
from motorbus.families.feetech.driver.scanning import GLANCE, Skipped, scan
from motorbus.families.feetech.driver.servo import AsyncServo, Servo, ServoMethods
from motorbus.families.feetech.driver.sharing import ScanWarning
from motorbus.families.feetech.driver.states import States, sync_read_raw, sync_read_states
from motorbus.families.feetech.driver.torque import (
    disable_torque,
    disable_torque_all,
    disable_torque_everyone,
)
from motorbus.families.feetech.driver.train import Train, limits, train, travel
from motorbus.families.feetech.driver.turns import clear_turns
from motorbus.families.feetech.driver.writer import SyncWriter, sync_writer

__all__ = [
    "GLANCE",
    "AsyncServo",
    "Calibration",
    "GroupResult",
    "ManyTurns",
    "Node",
    "Positions",
    "Powerless",
    "Promise",
    "Recounted",
    "Recovery",
    "ScanWarning",
    "Servo",
    "ServoMethods",
    "Settings",
    "Skipped",
    "States",
    "SyncWriter",
    "TorqueAfterWrite",
    "Train",
    "Zero",
    "action",
    "action_all",
    "alarms",
    "blockers",
    "calibrate",
    "cap_current",
    "cap_torque",
    "clear_turns",
    "copyable",
    "current",
    "disable_torque",
    "disable_torque_all",
    "disable_torque_everyone",
    "enable_torque",
    "factory_restore",
    "health",
    "identify",
    "limits",
    "load",
    "many_turns",
    "mode",
    "move",
    "ping",
    "position",
    "position_reads",
    "prepare",
    "prepare_all",
    "read",
    "read_positions",
    "read_raw",
    "recover",
    "recover_overload",
    "reg_write",
    "reg_write_all",
    "rewrite",
    "scan",
    "set_baud",
    "set_current",
    "set_duty",
    "set_id",
    "set_many_turns",
    "set_mode",
    "set_velocity",
    "step",
    "stop",
    "sync_read",
    "sync_read_positions",
    "sync_read_raw",
    "sync_read_states",
    "sync_write",
    "sync_write_positions",
    "sync_writer",
    "telemetry",
    "temperature",
    "torque_after_write",
    "train",
    "travel",
    "velocity",
    "voltage",
    "write",
    "zero",
]
