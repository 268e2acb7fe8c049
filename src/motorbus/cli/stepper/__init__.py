"""What only the stepper controller can do; so far without a controller: programs checked, timed, drawn and converted.

The only face that knows this family. `app` has the commands, each file some of them.
"""

from __future__ import annotations

from motorbus.cli.stepper import convert, programs, show
from motorbus.cli.stepper.files import app

__all__ = ["app", "convert", "programs", "show"]
