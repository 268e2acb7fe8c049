"""Harm by script, for simulated buses only: what a wire, a port, a supply and a device can do, and a record of it.

A script is text (`parse`); `FaultyLine` stands between the simulator and whatever serves it and does what the script
says; what happens to the bus and its devices as a whole does so in a `World`. What has happened is a script by position
again. There is no way to put any of this in front of a real device.
"""

from motorbus.simulation.faults.fault import ANY, Fault
from motorbus.simulation.faults.line import FaultyLine
from motorbus.simulation.faults.script import Script, parse
from motorbus.simulation.faults.struck import strike
from motorbus.simulation.faults.words import WORDS, Word
from motorbus.simulation.faults.world import Port, World

__all__ = [
    "ANY",
    "WORDS",
    "Fault",
    "FaultyLine",
    "Port",
    "Script",
    "Word",
    "World",
    "parse",
    "strike",
]
