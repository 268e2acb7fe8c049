"""`motorbus jog`: turn a device at a speed for a time, and stop. For setting up a machine by hand and eye."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.acting import acted
from motorbus.cli.consent import FAR
from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_named, is_name, machine
from motorbus.cli.moving import FAR_LINEAR, Goal, absolute, inside
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.robot import able, place, rehearse, robot
from motorbus.cli.target import device, offers, opened
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.machine.model import VELOCITY

if TYPE_CHECKING:
    from motorbus.cli.output import Output
    from motorbus.cli.robot import InHand

app = App(
    name="jog",
    usage="Usage: motorbus jog BUS#ID=VELOCITY|AXIS=VELOCITY --seconds SECONDS [OPTIONS]",
    help_epilogue="""VELOCITY is in rad/s, or with a unit: 60rpm, 90deg/s; its sign is the
direction. A way of more than 180 degrees needs --yes. It is stopped when the
time is over, and also when this is interrupted; keep a switch in the supply
within reach.

A stepper controller jogs with the speed of step 1 of its project 1: that is
borrowed and put back, nothing is saved, and `motorbus recover` puts it back
when this program was killed meanwhile.

An axis of a machine file goes in its own unit (a linear one in m/s, or 5mm/s),
inside its limits, and stays where it was stopped. A way of more than 100 mm
needs --yes, too.

Examples:

    motorbus jog shoulder=10deg/s --seconds 1
    motorbus jog stepper:/dev/ttyUSB0#1=60rpm --seconds 0.5
    motorbus jog stepper:/dev/ttyUSB0#1=-0.5turn/s --seconds 2s --yes
    motorbus jog stepper:sim#1=10rpm --seconds 1 --dry-run""",
)


@app.default
def jog(
    device_: Annotated[str, Parameter(name="DEVICE=VELOCITY")],
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
        The device or axis, and how fast it shall turn, as stepper:/dev/ttyUSB0#1=60rpm
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
    if is_name(where):
        return _axis(where, speed, units.parse(seconds, "time"), options, output, yes=yes, dry_run=dry_run)
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


def _axis(
    word: str, speed: str, span: float, options: dict[str, str], output: Output, *, yes: bool, dry_run: bool
) -> Exit:
    """The same for an axis of the machine file."""
    name, *more = axes_named((word,))
    if more:
        raise RequestError(f"{word} is several axes", expected="one axis", advice="nothing was sent")
    spec = machine().axes[name]
    velocity = units.parse(speed, VELOCITY.of(spec.linear))
    if not span > 0:
        raise RequestError(f"--seconds {span:g}: not above 0", advice="nothing was sent")
    way = abs(velocity * span)
    with robot([name], options, output) as hand:
        verb = able(hand, name, "jog")
        if dry_run:
            _rehearse(hand, name, velocity, span, show=True)
            return Exit.OK
        if way > (FAR_LINEAR if spec.linear else FAR) and not yes:
            _rehearse(hand, name, velocity, span, show=False)
            output.consent(f"move {name} by {spec.show(way)}", yes=False)
        with hand.working("jogging"):
            told = verb(velocity, span)
        present = hand.robot.positions([name])[name]
        stands = place(hand.robot, name, present)
    facts = {"axis": name, "velocity": velocity, "seconds": span, "present": present}
    output.document("motorbus.jog.axes/1", {**facts, "result": plain(told)})
    output.text(f"{name}: by {spec.show(told)}; now at {stands}")
    return Exit.OK


def _rehearse(hand: InHand, name: str, velocity: float, span: float, *, show: bool) -> None:
    """What it would be refused for, and what would be sent. Of an axis that is led, that is made on the way only."""
    from motorbus.motion.moving.jogging import way_of_jog

    axis = hand.robot[name]
    if "train" not in axis.able:
        rehearse(hand, [name], lambda one: one.jog(velocity, span), show=show)
        return
    goes, _ = way_of_jog(axis, velocity, span)
    present, goals = absolute(hand, {name: Goal(goes, way=True)})
    inside(hand, present, goals)
    if show:
        way = axis.spec.show(velocity * span)
        facts = {"axis": name, "velocity": velocity, "seconds": span, "at_most": velocity * span}
        hand.output.document("motorbus.jog.plan/1", facts)
        hand.output.text(
            f"{name} would go by {way} at most; nothing was sent. "
            "Its frames are made on the way, from what is read then, so none can be shown."
        )
