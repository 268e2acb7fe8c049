"""What to say to a stepper controller to get a thing done: one function for each, none of which sends anything itself.

Here is what looks and what stops: who is there, what it has stored, the level of an input, and an end to whatever it
does. Each takes a `Node` (a `Controller` is one) and returns an `Exchange`, or an operation that yields steps; a bus
carries it out.
"""

from __future__ import annotations

from motorbus.families.stepper.driver.controller import AsyncController, Controller
from motorbus.families.stepper.driver.memory import Memory
from motorbus.families.stepper.driver.node import Node, checked_motor
from motorbus.families.stepper.driver.presence import identify, ping
from motorbus.families.stepper.driver.reading import (
    dump,
    dump_once,
    read,
    read_input,
    read_project,
    read_raw,
    vote,
)
from motorbus.families.stepper.driver.scanning import Sends, scan
from motorbus.families.stepper.driver.stopping import Promise, stop

__all__ = [
    "AsyncController",
    "Controller",
    "Memory",
    "Node",
    "Promise",
    "Sends",
    "checked_motor",
    "dump",
    "dump_once",
    "identify",
    "ping",
    "read",
    "read_input",
    "read_project",
    "read_raw",
    "scan",
    "stop",
    "vote",
]
