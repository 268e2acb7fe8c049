"""`motorbus stepper inputs|read-input|outputs|set-output`: what goes into the controller, and what comes out of it.

An input is the only thing that a controller tells while it runs. An output tells nothing: what is shown of it is what
was commanded here, and another program, a button or a step may have switched it since.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Silent
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, ours, verb
from motorbus.cli.stepper.files import app
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.families.stepper import InputChanged
from motorbus.families.stepper.driver import Node, commands
from motorbus.families.stepper.table import ALL_OUTPUTS, INPUTS, OutputPort

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.cli.output import Bar, Output
    from motorbus.core.operation import Operation
