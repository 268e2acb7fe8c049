"""`motorbus home`: let a device find its reference, bounded in time and never left running."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.acting import acted
from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_named, is_name, machine
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.robot import able, place, rehearse, robot
from motorbus.cli.target import device, offers, opened, target
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.machine.model import VELOCITY

if TYPE_CHECKING:
    from motorbus.cli.output import Output

app = App(
    name="home",
    usage="Usage: motorbus home BUS#ID|AXIS... [OPTIONS]",
    help_epilogue="""Asks first, for the way to the switch may be long: --yes agrees. When the
switch is not met before the deadline it is stopped, and the command ends with
exit code 8. Ctrl-C stops it too. But the controller knows no end of it: when
this program is killed it goes on homing, so keep a switch in the supply within
reach.

A stepper controller homes in reverse, with the speed of step 1 of project 1,
until its input 5 is active. If that is active beforehand, it stands on the
switch or the switch is stuck, and nothing moves.

Axes of a machine file are homed together, those of several buses at the same
time, and none faster than its max_velocity: where its device is set to more,
project 1 is borrowed for a lower speed. An axis without a max_velocity in the
file has a low one. Nothing is remembered: `motorbus move --home` homes and
goes on.

Examples:

    motorbus home lift --deadline 20s
    motorbus home lift --velocity 5mm/s
    motorbus home stepper:/dev/ttyUSB0
    motorbus home stepper:/dev/ttyUSB0 --deadline 20s --velocity 30rpm --yes
    motorbus home stepper:/dev/ttyUSB0 --dry-run
    motorbus home stepper:sim,home_switch=wired --yes""",
)


@app.default
def home(
    *devices: Annotated[str, Parameter(name="BUS#ID|AXIS")],
    deadline: str = "",
    velocity: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Let a device find its reference.

    Parameters
    ----------
    devices
        FAMILY:PORT#ID, as stepper:/dev/ttyUSB0#1; or axes of the machine file.
    deadline
        How long it may take, as 20s; as the family says when left out.
    velocity
        How fast, in rad/s or as 30rpm, of a linear axis in m/s or as 5mm/s; as the device is set when left out.
    yes
        Do not ask before.
    options
        Any option of the bus string, as a flag.
    """
    if devices and all(map(is_name, devices)):
        return _axes(devices, deadline, velocity, options, output, yes=yes, dry_run=dry_run)
    if len(devices) != 1:
        raise RequestError(
            "one device is homed at a time, or axes of the machine file together",
            expected="BUS#ID, as stepper:/dev/ttyUSB0#1, or names of axes",
            advice="nothing was sent",
        )
    return homed(devices[0], deadline, velocity, options, output, yes=yes, dry_run=dry_run)


def homed(
    device_: str,
    deadline: str,
    velocity: str,
    options: dict[str, str],
    output: Output,
    *,
    yes: bool,
    dry_run: bool,
) -> Exit:
    """The same for whoever has a command of another name for it. Raises RequestError, NotHomed and what stops it."""
    bus, family, (node,) = device(device_)
    offers(family, "home")
    bounds = {
        **({"deadline": units.parse(deadline, "time")} if deadline else {}),
        **({"velocity": units.parse(velocity, "velocity")} if velocity else {}),
    }
    question = "" if yes else f"home #{node}: it moves until its switch is met, as far as that takes"
    with opened(bus, options, output) as opening:
        told = acted(opening, node, "home", question=question, dry_run=dry_run, output=output, **bounds)
    if not dry_run:
        output.document("motorbus.home/1", {"id": node, "result": plain(told)})
        output.text(f"#{node}: {told}")
    return Exit.OK


def _axes(
    words: tuple[str, ...],
    deadline: str,
    velocity: str,
    options: dict[str, str],
    output: Output,
    *,
    yes: bool,
    dry_run: bool,
) -> Exit:
    """Axes of the machine file, all at the same time."""
    names = axes_named(words)
    how = {
        "deadline": units.parse(deadline, "time") if deadline else None,
        "velocity": _pace(names, velocity),
    }
    for name in names:
        if not hasattr((family := target(name).family).devices.blocking, "home"):
            raise RequestError(
                f"{name}: {family.name} devices do not home",
                expected="axes that do",
                advice="nothing was sent",
            )
    with robot(names, options, output) as hand:
        for name in names:
            able(hand, name, "home")
        if dry_run:
            rehearse(hand, names, lambda axis: axis.home(**how))
            return Exit.OK
        what = f"home {', '.join(names)}: each moves until its switch is met, as far as that takes"
        if not yes:
            rehearse(hand, names, lambda axis: axis.home(**how), show=False)
        output.consent(what, yes=yes)
        with hand.working("homing"), hand.robot.attended():
            found = hand.robot.home(names, **how)
        rows = [(name, place(hand.robot, name, at)) for name, at in found.items()]
    output.document(
        "motorbus.home.axes/1", {"axes": [{"name": name, "at": at} for name, at in found.items()]}
    )
    output.table("", ["axis", ">at its switch"], rows)
    return Exit.OK


def _pace(names: list[str], velocity: str) -> float | None:
    """How fast they shall home (rad/s, m/s). Raises RequestError for what no velocity of them all can be.

    LimitExceeded for one above that of an axis, before a port is opened.
    """
    from motorbus.motion.limits import check_velocity

    kinds = {VELOCITY.of(machine().axes[name].linear) for name in names}
    paces = [units.parse(velocity, kind) for kind in kinds] if velocity else []
    if len(paces) > 1:
        raise RequestError(
            "one velocity for axes that turn and axes that are linear",
            expected="axes of one kind",
            advice="home them one after the other; nothing was sent",
        )
    for pace in paces:
        if not pace > 0:
            raise RequestError(
                f"--velocity {velocity}: not above 0",
                expected="a velocity above 0, as 5mm/s",
                advice="leave it out for the usual one; nothing was sent",
            )
        for name in names:
            check_velocity(name, machine().axes[name], pace)
    return paces[0] if paces else None
