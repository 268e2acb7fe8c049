"""What only the stepper controller can do: programs checked and timed, projects, runs, inputs and outputs.

The only face that knows this family. `app` has the commands, each file some of them; the rest is what common commands
use, see `motorbus.cli.faces`.
"""

from __future__ import annotations

from motorbus.cli.stepper import (
    copies,
    inputs,
    programs,
    projects,
    runs,
    show,
    writing,
)
from motorbus.cli.stepper.events import say
from motorbus.cli.stepper.files import app
from motorbus.cli.stepper.offers import COMMANDS, KEPT, planned, sample, written
from motorbus.cli.stepper.rehearsal import as_written

__all__ = [
    "COMMANDS",
    "KEPT",
    "app",
    "as_written",
    "copies",
    "inputs",
    "planned",
    "programs",
    "projects",
    "runs",
    "sample",
    "say",
    "show",
    "writing",
    "written",
]
