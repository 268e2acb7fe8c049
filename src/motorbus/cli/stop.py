"""`motorbus stop`: decelerate and hold. The arm stays up; `estop` is the other promise."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

from motorbus.cli import resting
from motorbus.cli.each import each
from motorbus.cli.exits import Exit
from motorbus.cli.machine import machine, machine_file, without_axes
from motorbus.cli.output import Output

app = App(
    name="stop",
    usage="Usage: motorbus stop [BUS[#ID] | AXIS]... [OPTIONS]",
    help_epilogue="""The devices keep their torque and hold where they come to rest. When it must
stop whatever happens, and may sag, say `motorbus estop`. A stepper controller
is told to end its project and to stop its motor; that both were accepted is
all that is ever known of it.

By the names of a machine file: an axis, a group, or a bus, which means its
axes in the file; with no name at all, every axis of the machine. All are
visited, whatever happens to another: a silent device has its line and exit
code 6. A name that is not in the file, or an error in the file, is refused.

A device that accepts a stop has heard it, and no more. With --verify each is
looked at afterwards, and what was seen is told beside its promise. One that
still moves, or did not answer, ends the command with exit code 9. Of a stepper
controller nobody can see that it rests.

It cannot stop what another process moves, for a bus has one owner: Ctrl-C
there, or SIGTERM to it, does; `motorbus estop` reaches it from any shell.

Examples:

    motorbus stop
    motorbus stop shoulder elbow --verify
    motorbus stop feetech:/dev/ttyACM0#3
    motorbus stop feetech:/dev/ttyACM0
    motorbus stop stepper:/dev/ttyUSB0""",
)


@app.default
def stop(
    *devices: Annotated[str, Parameter(name="BUS#ID")],
    verify: Annotated[bool, Parameter(negative="")] = False,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Decelerate and hold.

    Parameters
    ----------
    devices
        FAMILY:PORT for every device that answers, FAMILY:PORT#ID for some, or axes; all axes when left out.
    verify
        When everyone has been told to stop, look whether each rests: three fresh readings at one place, over
        a tenth of a second, for 1 s at most.
    dry_run
        Only read; show the frames that it would send.
    options
        Any option of the bus string, as a flag.
    """
    words: tuple[str, ...] = devices
    if not words and machine_file().path is not None:
        known = machine()
        words = tuple(known.axes or known.buses)
        if not words:
            raise without_axes()
    look = resting.look if verify else None
    return each("stop", "stop", words, options, output, dry_run=dry_run, look=look)
