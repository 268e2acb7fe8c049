"""A programmable controller for one stepper motor: 27 commands, four stored projects of up to ten steps.

It replies with an acknowledgement, a dump of a project or the level of one input, and sends one notice: the
project that was started has ended. It reports neither position nor state nor errors, so positions and times
are estimates by a model of the controller (`execution`).

`Controller` and `AsyncController` are the controller; `Program` is a project as a file, `Backup` a copy of all
projects. The other names are results and events of their methods.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import DeviceTypes, Family, LinkSpec, Option
from motorbus.families.stepper.driver.bus import StepperDriver
from motorbus.families.stepper.driver.controller import AsyncController, Controller
from motorbus.families.stepper.driver.io import InputChanged
from motorbus.families.stepper.driver.manual import Homed, Moved
from motorbus.families.stepper.driver.projects import Written
from motorbus.families.stepper.driver.run import Outcome, Ran
from motorbus.families.stepper.driver.stop import Promise
from motorbus.families.stepper.execution.ramp import TICK_MS
from motorbus.families.stepper.parameters import TABLES
from motorbus.families.stepper.program.backup import Backup
from motorbus.families.stepper.program.estimate import Estimate
from motorbus.families.stepper.program.file import Program
from motorbus.families.stepper.program.lint import Finding
from motorbus.families.stepper.protocol import COMMANDS, MOTOR, ONLY, RATE

__all__ = [
    "FAMILY",
    "AsyncController",
    "Backup",
    "Controller",
    "Estimate",
    "Finding",
    "Homed",
    "InputChanged",
    "Moved",
    "Outcome",
    "Program",
    "Promise",
    "Ran",
    "StepperDriver",
    "Written",
]

_SETTINGS: Final = (
    Option("motor", int, MOTOR, "number of the motor in its commands; the manual knows 3"),
    Option(
        "dump_order", str, "little", "byte of a number that is first in a dump: the lowest or the highest",
        ("little", "big"), "the manual has the lowest first in requests and does not say it of the dump",
    ),
    Option(
        "ramp_tick_ms", float, TICK_MS, "ms in which the frequency grows by the acceleration", (),
        "the manual does not say it; time a run of two lengths to find it",
    ),
)  # fmt: skip

FAMILY: Final = Family(
    name="stepper",
    link=LinkSpec("bytes", RATE, (RATE,), _SETTINGS, only=ONLY),
    registers=TABLES,
    devices=DeviceTypes(Controller, AsyncController),
    driver=StepperDriver,
    simulator_module="motorbus.families.stepper.simulator",
    checks_module="motorbus.families.stepper.checks",
    recording_module="motorbus.families.stepper.protocol",
    commands={name: getattr(Controller, name).function for name in COMMANDS},
)
