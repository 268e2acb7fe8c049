"""`motorbus hold`: the axes of a machine stay where they are, with their torque on."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_named
from motorbus.cli.parameters import DryRun, Silent
from motorbus.cli.robot import place, rehearse, robot

app = App(
    name="hold",
    usage="Usage: motorbus hold [AXIS]... [OPTIONS]",
    help_epilogue="""Where a device has a switch for its torque, that goes on without a jump, with
the cap of the machine file; others are stopped, and stay. With no name, every
axis of the machine. They hold on when this command ends, whatever `exit` says
in the file. `motorbus stop` is for axes that move; it asks fewer questions.

Examples:

    motorbus hold
    motorbus hold shoulder elbow
    motorbus hold left --dry-run""",
)


@app.default
def hold(
    *axes: Annotated[str, Parameter(name="AXIS")],
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Stay, with torque.

    Parameters
    ----------
    axes
        Axes, groups and buses of the machine file; every axis when left out.
    options
        Any option of the bus string, as a flag.
    """
    names = axes_named(axes)
    with robot(names, options, output) as hand:
        if dry_run:
            rehearse(hand, names, lambda axis: axis.hold())
            return Exit.OK
        with hand.working("holding"):
            hand.robot.hold(names)
        places = hand.robot.positions(names)
        rows = [(name, place(hand.robot, name, at)) for name, at in places.items()]
    output.document(
        "motorbus.hold/1", {"axes": [{"name": name, "present": at} for name, at in places.items()]}
    )
    output.table("", ["axis", ">holds at"], rows)
    return Exit.OK
