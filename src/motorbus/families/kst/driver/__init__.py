"""What to say to KST CAN servos to get a thing done: one function for each, none of which sends anything itself.

Functions of one servo take a `Node` (a `Servo` is one); what goes to everyone takes the `Dialect` of the bus. Each
returns a `Request`, or is a procedure that awaits steps; a bus carries it out.
"""

from __future__ import annotations

from motorbus.families.kst.driver.broadcast import (
    broadcast_bit_rate,
    broadcast_node_id,
    broadcast_position,
    broadcast_read,
    broadcast_save,
)
from motorbus.families.kst.driver.configuration import (
    reversed_,
    set_mid_point,
    set_reversed,
    set_travel_limits,
    start_reports,
    stop_reports,
    travel_limits,
)
from motorbus.families.kst.driver.dialect import (
    ID_FORMATS,
    NMT,
    PLAIN,
    SIZED,
    WINDOW,
    Dialect,
    Ear,
    Memory,
    dialect_of,
    window,
)
from motorbus.families.kst.driver.feedback import (
    RawStatus,
    Status,
    current,
    position,
    raw_status,
    status,
    telemetry,
    temperature,
)
from motorbus.families.kst.driver.health import health
from motorbus.families.kst.driver.identity import (
    bit_rate,
    identify,
    node_id,
    ping,
    set_bit_rate,
    set_node_id,
    version,
)
from motorbus.families.kst.driver.keeping import save
from motorbus.families.kst.driver.listening import Heard
from motorbus.families.kst.driver.motion import Promise, Started, limits, move, stop, travel
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.provisioning import PowerCycleNeeded, Provisioned, provision
from motorbus.families.kst.driver.rates import BitRates, scan_bit_rates
from motorbus.families.kst.driver.registers import read, read_raw, write
from motorbus.families.kst.driver.scanning import Skipped, Suspicion, scan
from motorbus.families.kst.driver.servo import AsyncServo, Servo, ServoVerbs
from motorbus.families.kst.driver.train import Train, train

__all__ = [
    "ID_FORMATS",
    "NMT",
    "PLAIN",
    "SIZED",
    "WINDOW",
    "AsyncServo",
    "BitRates",
    "Dialect",
    "Ear",
    "Heard",
    "Memory",
    "Node",
    "PowerCycleNeeded",
    "Promise",
    "Provisioned",
    "RawStatus",
    "Servo",
    "ServoVerbs",
    "Skipped",
    "Started",
    "Status",
    "Suspicion",
    "Train",
    "bit_rate",
    "broadcast_bit_rate",
    "broadcast_node_id",
    "broadcast_position",
    "broadcast_read",
    "broadcast_save",
    "current",
    "dialect_of",
    "health",
    "identify",
    "limits",
    "move",
    "node_id",
    "ping",
    "position",
    "provision",
    "raw_status",
    "read",
    "read_raw",
    "reversed_",
    "save",
    "scan",
    "scan_bit_rates",
    "set_bit_rate",
    "set_mid_point",
    "set_node_id",
    "set_reversed",
    "set_travel_limits",
    "start_reports",
    "status",
    "stop",
    "stop_reports",
    "telemetry",
    "temperature",
    "train",
    "travel",
    "travel_limits",
    "version",
    "window",
    "write",
]
