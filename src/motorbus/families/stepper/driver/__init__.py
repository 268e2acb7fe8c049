"""What to say to a stepper controller to get a thing done: one function for each, none of which sends anything itself.

Here is what looks, what writes, what moves and what stops. Each takes a `Node` (a `Controller` is one) and
returns a `Request`, or is a procedure that awaits steps; a bus carries it out.
"""

from __future__ import annotations

from motorbus.families.stepper.driver.controller import AsyncController, Controller
from motorbus.families.stepper.driver.copying import backup, restore
from motorbus.families.stepper.driver.costs import Cost
from motorbus.families.stepper.driver.editing import Change
from motorbus.families.stepper.driver.homing import Homed, home
from motorbus.families.stepper.driver.inputs import InputChanged, Watched, watch_inputs
from motorbus.families.stepper.driver.jogging import (
    Moved,
    jog,
    jog_forward,
    jog_reverse,
    move_by,
    run_once,
)
from motorbus.families.stepper.driver.keeping import keep_time, shortest
from motorbus.families.stepper.driver.memory import Memory
from motorbus.families.stepper.driver.node import Node, checked_motor
from motorbus.families.stepper.driver.outputs import last_commanded, set_output
from motorbus.families.stepper.driver.owing import Unrecorded
from motorbus.families.stepper.driver.presence import identify, ping
from motorbus.families.stepper.driver.progress import Estimated
from motorbus.families.stepper.driver.reading import (
    dump,
    dump_once,
    read,
    read_input,
    read_project,
    read_raw,
    vote,
)
from motorbus.families.stepper.driver.recovery import recover
from motorbus.families.stepper.driver.running import run, start_project
from motorbus.families.stepper.driver.scanning import Sends, scan
from motorbus.families.stepper.driver.selecting import EditsLost, clear, save, select
from motorbus.families.stepper.driver.stopping import Promise, stop
from motorbus.families.stepper.driver.turning import Slowing
from motorbus.families.stepper.driver.waiting import Outcome, Ran
from motorbus.families.stepper.driver.writing import (
    Difference,
    Planned,
    Proof,
    Written,
    difference,
    write,
    write_project,
)

__all__ = [
    "AsyncController",
    "Change",
    "Controller",
    "Cost",
    "Difference",
    "EditsLost",
    "Estimated",
    "Homed",
    "InputChanged",
    "Memory",
    "Moved",
    "Node",
    "Outcome",
    "Planned",
    "Promise",
    "Proof",
    "Ran",
    "Sends",
    "Slowing",
    "Unrecorded",
    "Watched",
    "Written",
    "backup",
    "checked_motor",
    "clear",
    "difference",
    "dump",
    "dump_once",
    "home",
    "identify",
    "jog",
    "jog_forward",
    "jog_reverse",
    "keep_time",
    "last_commanded",
    "move_by",
    "ping",
    "read",
    "read_input",
    "read_project",
    "read_raw",
    "recover",
    "restore",
    "run",
    "run_once",
    "save",
    "scan",
    "select",
    "set_output",
    "shortest",
    "start_project",
    "stop",
    "vote",
    "watch_inputs",
    "write",
    "write_project",
]
