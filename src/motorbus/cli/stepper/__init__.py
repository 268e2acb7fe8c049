"""What only the stepper controller can do; so far without a controller: programs checked, timed, drawn and converted.

What of a running one can be asked or stopped has common commands: scan, ping, info, read, stop, estop.

The only face that knows this family. `app` has the commands, each file some of them.
"""

from __future__ import annotations

from motorbus.cli.stepper import convert, programs, show
from motorbus.cli.stepper.files import app
from motorbus.families.stepper import Sends

__all__ = ["app", "convert", "programs", "say", "show"]


def say(event: object) -> str:
    """What an event says to people: nothing is sent to find a controller without telling which frame it is."""
    if not (isinstance(event, Sends) and isinstance(event.request, bytes)):
        return ""
    return f"to find out who is there, this is sent and nothing else: {event.request.hex(' ').upper()} (read project 1)"
