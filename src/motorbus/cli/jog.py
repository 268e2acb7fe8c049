"""`motorbus jog`: turn a device at a speed for a time, and stop. For setting up a machine by hand and eye."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

from motorbus.cli.acting import acted
from motorbus.cli.consent import FAR
from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.target import device, offers, opened
from motorbus.core import units
from motorbus.errors import RequestError

app = App(
    name="jog",
    usage="Usage: motorbus jog BUS#ID=VELOCITY --seconds SECONDS [OPTIONS]",
    help_epilogue="""VELOCITY is in rad/s, or with a unit: 60rpm, 90deg/s; its sign is the
direction. A way of more than 180 degrees needs --yes. It is stopped when the
time is over, and also when this is interrupted; keep a switch in the supply
within reach.

A stepper controller jogs with the speed of step 1 of its project 1: that is
borrowed and put back, nothing is saved, and `motorbus recover` puts it back
when this program was killed meanwhile.

Examples:

    motorbus jog stepper:/dev/ttyUSB0#1=60rpm --seconds 0.5
    motorbus jog stepper:/dev/ttyUSB0#1=-0.5turn/s --seconds 2s --yes
    motorbus jog stepper:sim#1=10rpm --seconds 1 --dry-run""",
)


@app.default
def jog(
    device_: Annotated[str, Parameter(name="BUS#ID=VELOCITY")],
    /,
    *,
    seconds: str,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Turn a device at a speed for a time, and stop.

    Parameters
    ----------
    device_
        The device, and how fast it shall turn, as stepper:/dev/ttyUSB0#1=60rpm
    seconds
        How long, in s or as 500ms.
    yes
        Do not ask before a way of more than 180 degrees.
    options
        Any option of the bus string, as a flag.
    """
    where, equals, speed = device_.rpartition("=")
    if not equals:
        raise RequestError(
            f"{device_}: how fast?", expected="BUS#ID=VELOCITY, as stepper:/dev/ttyUSB0#1=60rpm"
        )
    bus, family, (node,) = device(where)
    offers(family, "jog")
    velocity, span = units.parse(speed, "velocity"), units.parse(seconds, "time")
    way = abs(velocity * span)
    question = f"turn #{node} by {units.show(way, 'position')}" if way > FAR and not yes else ""
    with opened(bus, options, output) as opening:
        told = acted(opening, node, "jog", velocity, span, question=question, dry_run=dry_run, output=output)
    if dry_run:
        return Exit.OK
    facts = {"id": node, "velocity": velocity, "seconds": span, "result": plain(told)}
    output.document("motorbus.jog/1", facts)
    output.text(f"#{node}: {told}")
    return Exit.OK
