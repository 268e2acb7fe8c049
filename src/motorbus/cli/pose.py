"""`motorbus pose`: go to a pose of the machine file, list those that there are, keep the present one."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.files import replaced
from motorbus.cli.machine import asked_of_the_file, axes_named, machine, machine_file, shown
from motorbus.cli.moving import Goal, How, Known, go, how_of, positions_of
from motorbus.cli.parameters import Assume, DryRun, Duration, First, Flag, Shape, Silent, Speed
from motorbus.cli.robot import robot
from motorbus.core import units
from motorbus.errors import NotHomed, RequestError
from motorbus.motion.machine.model import NAME, POSITION

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.cli.output import Output
    from motorbus.motion.machine import AxisSpec

DIGITS = {"deg": 2, "mm": 3, "turn": 5}
"""Decimals in which a pose is kept; 5 in rad and 6 in m."""

app = App(
    name="pose",
    usage="Usage: motorbus pose [NAME | --save NAME [AXIS]...] [OPTIONS]",
    help_epilogue="""With a name, its axes go there in one movement and stay with torque on; what
asks first, and how an axis without feedback is told where it stands, is as for
`motorbus move`. Without a name, lists the poses and sends nothing.

--save keeps where the axes stand now, all or those that are named, as a pose
of the machine file, in the unit of each axis. The rest of the file, comments
too, stays as it is. A pose of that name is replaced with --force only. An axis
that does not know where it is is left out, unless it is named: then --assume
says where it stands.

Examples:

    motorbus pose
    motorbus pose ready
    motorbus pose ready --duration 4s --yes
    motorbus pose --save ready
    motorbus pose --save grip shoulder elbow --force""",
)


@app.default
def pose(
    *names: Annotated[str, Parameter(name="NAME")],
    save: str = "",
    force: Flag = False,
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
    """Go to a pose of the machine, list its poses, or keep the present one.

    Parameters
    ----------
    names
        The pose; with --save, the axes to keep, all when left out.
    save
        Keep where the axes stand as a pose of this name.
    force
        Replace a pose that has that name already.
    yes
        Do not ask before a way of more than 180 degrees, or 100 mm.
    options
        Any option of the bus string, as a flag.
    """
    how, known = how_of(duration, kind, speed), Known(positions_of(assume), home)
    if save:
        return _keep(save, names, known, options, output, force=force, more=dry_run or home or how != How())
    if not names:
        return _list(output)
    if len(names) > 1 or force:
        raise RequestError(
            "one pose at a time" if len(names) > 1 else "--force replaces a pose that is saved",
            expected="NAME, or --save NAME [AXIS]...",
            advice="nothing was sent",
        )
    with asked_of_the_file():
        goals = {axis: Goal(at, way=False) for axis, at in machine().pose(names[0]).items()}
    with robot(list(dict.fromkeys([*goals, *known.stands])), options, output) as hand:
        go(hand, "pose", goals, how, known, yes=yes, dry_run=dry_run)
    return Exit.OK


def _list(output: Output) -> Exit:
    found, axes = machine().poses, machine().axes
    output.document("motorbus.poses/1", {"poses": {name: dict(places) for name, places in found.items()}})
    if not found:
        output.note("no pose is kept in the machine file; `motorbus pose --save NAME` keeps the present one")
        return Exit.OK
    rows = [
        (name, ", ".join(f"{axis} {axes[axis].show(at)}" for axis, at in places.items()))
        for name, places in found.items()
    ]
    output.table("", ["pose", "axes"], rows)
    return Exit.OK


def _keep(
    name: str,
    words: tuple[str, ...],
    known: Known,
    options: Mapping[str, str],
    output: Output,
    *,
    force: bool,
    more: bool,
) -> Exit:
    """Write where the axes stand into the file."""
    _can_be_kept(name, force=force, more=more)
    axes = axes_named(words)
    with robot(list(dict.fromkeys([*axes, *known.stands])), options, output) as hand:
        places = {**hand.robot.positions(axes), **known.stands}
    lost = [axis for axis, at in places.items() if at is None]
    if any(axis in words for axis in lost) or len(lost) == len(places):
        raise NotHomed(
            f"{', '.join(lost)}: it is not known where it stands",
            expected=f"--assume {lost[0]}=POSITION",
            advice="say where it stands, or leave it out; nothing was written",
        )
    if lost:
        output.note(f"note: {', '.join(lost)}: it is not known where it stands, so it is left out")
    kept = {axis: at for axis, at in places.items() if at is not None}
    _write(name, {axis: _written(machine().axes[axis], at) for axis, at in kept.items()})
    output.document("motorbus.pose.save/1", {"pose": name, "axes": kept, "file": str(machine_file().path)})
    output.table(
        f"Pose {name}",
        ["axis", ">position"],
        [(axis, machine().axes[axis].show(at)) for axis, at in kept.items()],
    )
    return Exit.OK


def _can_be_kept(name: str, *, force: bool, more: bool) -> None:
    if more:
        raise RequestError(
            "--save moves nothing", expected="no --dry-run, --home, --duration, --kind or --speed"
        )
    if not re.fullmatch(NAME, name):
        raise RequestError(
            f"a pose cannot be called {name!r}",
            expected="a lower case letter, then lower case letters, digits, _ and -, 40 at most",
            advice="nothing was sent",
        )
    if name in machine().poses and not force:
        raise RequestError(
            f"there is a pose {name} already",
            expected="another name, or --force to replace it",
            advice="nothing was written",
        )


def _written(spec: AxisSpec, at: float) -> str:
    """A position as a person would write it in the file."""
    scale = units.SCALES[POSITION.of(spec.linear)][spec.unit]
    digits = DIGITS.get(spec.unit, 5 if spec.unit == "rad" else 6)
    return f"{at / scale:.{digits}f} {spec.unit}"


def _write(name: str, places: Mapping[str, str]) -> None:
    from motorbus.motion.machine import edited, source

    path = machine_file().path
    assert path is not None
    try:
        text = edited(source(path), {f"pose.{name}": dict(places)})
    except RequestError as error:
        error.summary = f"{shown(path)} cannot keep this pose: {error.summary}"
        error.advice = error.advice.replace("nothing was opened", "nothing was written")
        raise
    replaced(path, text)
