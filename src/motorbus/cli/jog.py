"""`motorbus jog`: turn a device at a speed for a time, and stop. For setting up a machine by hand and eye."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import App, Parameter

from motorbus.cli.acting import acted
from motorbus.cli.consent import FAR
from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_named, is_name, machine
from motorbus.cli.moving import FAR_LINEAR, Goal, absolute, inside
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.rates import time_of
from motorbus.cli.robot import able, place, rehearse, robot
from motorbus.cli.target import device, offers, opened
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.machine.model import VELOCITY

if TYPE_CHECKING:
    from motorbus.cli.output import Output
    from motorbus.cli.robot import InHand
    from motorbus.motion.clamping import Policy

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
needs --yes, too. A way that leads out of the limits is refused; with --clamp
it ends there, which is told.

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
    clamp: Flag = False,
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
    clamp
        An axis of a machine file that would leave its limits goes as far as they allow; else that is refused.
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
    span = time_of(seconds, advice="say for how long; the sign of the velocity is the direction")
    if is_name(where):
        how = _How(span, "clamp" if clamp else "reject")
        return _axis(where, speed, how, options, output, yes=yes, dry_run=dry_run)
    if clamp:
        raise _nothing_to_clamp()
    bus, family, (node,) = device(where)
    offers(family, "jog")
    velocity = units.parse(speed, "velocity")
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


def _nothing_to_clamp() -> RequestError:
    return RequestError(
        "--clamp is for axes of a machine file",
        expected="AXIS=VELOCITY with --clamp",
        cause="a device by its address has no limits that anybody wrote down",
        advice="leave it out; nothing was sent",
    )


class _How(NamedTuple):
    """For so long (s), and what becomes of a way that leads out of the limits."""

    span: float
    policy: Policy


def _axis(
    word: str, speed: str, how: _How, options: dict[str, str], output: Output, *, yes: bool, dry_run: bool
) -> Exit:
    """The same for an axis of the machine file."""
    name, *more = axes_named((word,))
    if more:
        raise RequestError(f"{word} is several axes", expected="one axis", advice="nothing was sent")
    spec, span = machine().axes[name], how.span
    velocity = _velocity(name, speed)
    far, way = FAR_LINEAR if spec.linear else FAR, abs(velocity * span)
    with robot([name], options, output) as hand:
        verb = able(hand, name, "jog")
        if dry_run:
            _rehearse(hand, name, velocity, how, show=True)
            return Exit.OK
        if way > far and not yes:
            most = _rehearse(hand, name, velocity, how, show=False)
            if abs(most) > far:
                output.consent(f"move {name} by {spec.show(abs(most))}", yes=False)
        with hand.working("jogging"):
            told = verb(velocity, span, policy=how.policy)
        present = hand.robot.positions([name])[name]
        stands = place(hand.robot, name, present)
    facts = {"axis": name, "velocity": velocity, "seconds": span, "present": present}
    output.document("motorbus.jog.axes/1", {**facts, "result": plain(told)})
    output.text(f"{name}: by {spec.show(told)}; now at {stands}")
    return Exit.OK


def _velocity(name: str, text: str) -> float:
    """A velocity of this axis (rad/s, m/s). Raises RequestError, naming it, for what is none."""
    from motorbus.motion.several import named

    try:
        return units.parse(text, VELOCITY.of(machine().axes[name].linear))
    except RequestError as error:
        raise named(name, error) from None


def _rehearse(hand: InHand, name: str, velocity: float, how: _How, *, show: bool) -> float:
    """How far it would go at most (rad, m, with its sign). Raises what it would be refused for.

    What would be sent is shown; of an axis that is led, that is made on the way only.
    """
    from motorbus.motion.moving.jogging import way_of_jog

    axis = hand.robot[name]
    if "stream" not in axis.able:
        rehearse(hand, [name], lambda one: one.jog(velocity, how.span, policy=how.policy), show=show)
        return velocity * how.span
    goes, _ = way_of_jog(axis, velocity, how.span)
    present, goals = absolute(hand, {name: Goal(goes, way=True)})
    most = velocity * how.span
    if how.policy == "reject":
        inside(hand, present, goals)
    else:
        most = _clamped(hand, name, present[name], goals[name], most, show=show)
    if show:
        facts = {"axis": name, "velocity": velocity, "seconds": how.span, "at_most": most}
        hand.output.document("motorbus.jog.plan/1", facts)
        hand.output.text(
            f"{name} would go by {axis.spec.show(most)} at most; nothing was sent. "
            "Its frames are made on the way, from what is read then, so none can be shown."
        )
    return most


def _clamped(hand: InHand, name: str, present: float, goal: float, most: float, *, show: bool) -> float:
    """How far it would go at most where its limits hold it back (rad, m); that it does is told where that is shown."""
    from motorbus.motion import limits
    from motorbus.motion.clamping import kept

    axis = hand.robot[name]
    device = axis.bus.run(limits.of_device(axis))
    to, told = kept(name, axis.spec, goal, policy="clamp", device=device)
    if told is None:
        return most
    if show:
        hand.heard(told)
    way = to - present
    return way if way * most > 0 else 0.0
