"""`motorbus park`: the axes of a machine go where the machine file says that they are parked."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.machine import asked_of_the_file, axes_named, machine
from motorbus.cli.moving import Goal, Known, go, how_of, positions_of
from motorbus.cli.parameters import Assume, DryRun, Duration, First, Flag, Shape, Silent, Speed
from motorbus.cli.robot import robot
from motorbus.errors import RequestError

app = App(
    name="park",
    usage="Usage: motorbus park [AXIS]... [OPTIONS]",
    help_epilogue="""Goes to `park` of each axis in the machine file, all in one movement, and stays
there with torque on. With no name, every axis that has a `park`; an axis that
is named must have one. What asks first, and how an axis without feedback is
told where it stands, is as for `motorbus move`.

Examples:

    motorbus park
    motorbus park shoulder elbow --speed 50%
    motorbus park lift --home --yes
    motorbus park --dry-run""",
)


@app.default
def park(
    *axes: Annotated[str, Parameter(name="AXIS")],
    duration: Duration = "",
    kind: Shape = "trapezoid",
    speed: Speed = "",
    assume: Assume = (),
    home: First = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Go where the machine file says that the axes are parked.

    Parameters
    ----------
    axes
        Axes, groups and buses of the machine file; every axis that has a place to park when left out.
    yes
        Do not ask before a way of more than 180 degrees, or 100 mm.
    options
        Any option of the bus string, as a flag.
    """
    how, known = how_of(duration, kind, speed), Known(positions_of(assume), home)
    named = axes_named(axes)
    with asked_of_the_file():
        goals = _places(axes, named)
    with robot(list(dict.fromkeys([*goals, *known.stands])), options, output) as hand:
        go(hand, "park", goals, how, known, yes=yes, dry_run=dry_run)
    return Exit.OK


def _places(words: tuple[str, ...], axes: list[str]) -> dict[str, Goal]:
    """Where each parks. Raises RequestError for one that is named and has no place, and when none has one."""
    found: dict[str, Goal] = {}
    for name in axes:
        spec = machine().axes[name]
        if spec.park is not None:
            found[name] = Goal(spec.park, way=False)
        elif name in words:
            raise _no_place(f"{name} has no place to park", name)
    if not found:
        raise _no_place(f"no axis {'of them ' if words else ''}has a place to park", "NAME")
    return found


def _no_place(what: str, name: str) -> RequestError:
    return RequestError(
        what,
        expected=f'park = "0 deg" in [axis.{name}]',
        advice="add it to the machine file; nothing was sent",
    )
