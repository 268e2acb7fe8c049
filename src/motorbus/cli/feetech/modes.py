"""`motorbus feetech mode|drive`: what a servo heeds, what keeps it from obeying, and orders beyond a position."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from cyclopts import Parameter

from motorbus.cli import dry
from motorbus.cli.consent import FAR, consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import (
    BusOption,
    Device,
    assigned,
    on_servo,
    one_of_ours,
    reads_only,
)
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import takes
from motorbus.cli.wording import shell_words
from motorbus.core import units
from motorbus.errors import MotionError, RequestError
from motorbus.families.feetech.driver import Servo

if TYPE_CHECKING:
    from collections.abc import Mapping

ORDERS: Final[Mapping[str, tuple[str, str]]] = {
    "velocity": ("set_velocity", "velocity"),
    "duty": ("set_duty", "load"),
    "current": ("set_current", "current"),
    "step": ("step", "position"),
}
"""Word of an order -> the verb that gives it, and the quantity of its value."""


@app.command(
    usage="Usage: motorbus feetech mode BUS#ID [MODE] [OPTIONS]",
    help_epilogue="""Every servo has position and pwm; STS and newer SMS velocity and step too, old
SMS velocity, HLS velocity and current. On SCS servos pwm is both limits 0, and
position needs --low and --high. Without MODE it says what the servo heeds, and
what would keep it from obeying an order: a torque limit of 0, a goal torque of
0, limits without a way between them, an alarm that lets its torque drop.

Examples:

    motorbus feetech mode feetech:/dev/ttyACM0#3
    motorbus feetech mode feetech:/dev/ttyACM0#3 velocity --yes
    motorbus feetech mode feetech:/dev/ttyACM0#3 position --low 20deg --high 290deg --yes
    motorbus feetech mode feetech:/dev/ttyACM0#3 step --dry-run""",
)
def mode(
    device_: Device,
    mode_: Annotated[
        Literal["position", "velocity", "pwm", "step", "current", ""], Parameter(name="MODE")
    ] = "",
    /,
    *,
    low: str = "",
    high: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Say what a servo heeds and what blocks it, or put it into another mode.

    Parameters
    ----------
    mode_
        position, velocity, pwm, step or current; left out, it is read.
    low
        Lowest position of an SCS servo that becomes a servo again, as 20deg.
    high
        Its highest position.
    yes
        Do not ask before the mode is written for good and the servo goes limp.
    """
    family = one_of_ours(device_).family
    limits = _limits(low, high)
    if not mode_:
        reads_only(dry_run)
        if limits:
            raise RequestError(
                "limits without a mode", expected="MODE, as position", advice="nothing was sent"
            )

    def change(one: Servo) -> dict[str, Any] | None:
        if mode_:
            one.set_mode(mode_, limits=limits)
        return None if dry_run else _heeds(one)

    def consent(one: Servo) -> str:
        return f"put #{one.node} into {mode_} mode, for good, and let it go limp" if mode_ and not yes else ""

    node, told = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if told is None:
        return Exit.OK
    blockers = [shell_words(words, family) for words in told.pop("blockers")]
    output.document("motorbus.feetech.mode/1", {"id": node, **told, "blockers": blockers})
    rows = [("mode", told["mode"] or f"{told['code']}, which is not documented"), ("lock", told["lock"])]
    output.table(f"#{node}", ["", ""], rows + [("blocked", words) for words in blockers])
    return Exit.OK


def _limits(low: str, high: str) -> tuple[float, float] | None:
    if bool(low) != bool(high):
        raise RequestError("one limit alone", expected="both --low and --high", advice="nothing was sent")
    return (units.parse(low, "position"), units.parse(high, "position")) if low else None


def _heeds(one: Servo) -> dict[str, Any]:
    blockers = one.blockers()
    locked = one.read_raw("lock")["lock"]
    assert one.table is not None
    assert one.settings is not None
    heeded = one.known_mode
    return {
        "mode": heeded.value if heeded else None,
        "code": one.settings.mode_code,
        "lock": one.table["lock"].choices[locked].partition(":")[0],
        "blockers": blockers,
    }


@app.command(
    usage="Usage: motorbus feetech drive BUS#ID ORDER=VALUE [OPTIONS]",
    help_epilogue="""ORDER is velocity (velocity mode), duty (pwm mode), current (HLS, current mode)
or step (step mode); `motorbus feetech mode` sets the mode, `motorbus torque on`
the torque, which comes on at rest. What turns without end needs --yes, and so
does a step of more than 180 degrees; `motorbus stop` or an order of 0 ends it.
Ends with exit code 1 and the reason where a setting keeps the servo from
obeying.

Examples:

    motorbus feetech drive feetech:/dev/ttyACM0#3 velocity=30rpm --yes
    motorbus feetech drive feetech:/dev/ttyACM0#3 velocity=0
    motorbus feetech drive feetech:/dev/ttyACM0#3 step=-45deg --velocity 1.5
    motorbus feetech drive feetech:/dev/ttyACM0#3 duty=20% --dry-run
    motorbus feetech drive feetech:/dev/ttyACM0#3 current=0.5 --yes""",
)
def drive(
    device_: Device,
    order: Annotated[str, Parameter(name="ORDER=VALUE")],
    /,
    *,
    velocity: str = "",
    acceleration: str = "",
    current: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Give a servo a velocity, a duty, a current, or a way to go.

    Parameters
    ----------
    order
        velocity=VALUE, duty=VALUE, current=VALUE or step=VALUE.
    velocity
        A step at most so fast, in rad/s or as 90deg/s.
    acceleration
        A step or velocity at most so steep, in rad/s² or as 500deg/s2.
    current
        On HLS a velocity with at most so much current, in A.
    yes
        Do not ask before it turns without end, or by more than 180 degrees.
    """
    family = one_of_ours(device_).family
    ((name, text),) = assigned([order], ORDERS).items()
    verb, quantity = ORDERS[name]
    value = units.parse(text, quantity)
    bounds = {"velocity": velocity, "acceleration": acceleration, "current": current}
    given = {bound: units.parse(text, bound) for bound, text in bounds.items() if text}

    def go(one: Servo) -> tuple[str, ...]:
        takes(one, verb, given)
        rehearsal = Servo(dry.DryBus(one.bus), one.node)  # type: ignore[arg-type]
        rehearse = partial(getattr(rehearsal, verb), value, **given)
        what = _far(one.node, name, value)
        consent_to(what, output, yes=yes or dry_run or not what, rehearse=rehearse)
        getattr(one, verb)(value, **{**given, **({"wait": False} if dry_run and verb == "step" else {})})
        return () if dry_run or value == 0 else one.blockers()

    node, blockers = on_servo(device_, options, output, go, dry_run=dry_run)
    if dry_run:
        return Exit.OK
    said = [shell_words(words, family) for words in blockers or ()]
    output.document("motorbus.feetech.drive/1", {"id": node, "order": name, "value": value, "blockers": said})
    if said:
        raise MotionError(
            f"#{node} took the order {name}={text}, and will not obey it: {'; '.join(said)}",
            advice="`motorbus feetech mode` says this without an order",
            node=node,
        )
    output.text(f"#{node}: {name} {units.show(value, quantity)}")
    return Exit.OK


def _far(node: int, order: str, value: float) -> str:
    """What somebody must agree to before this order, "" for nothing."""
    if order != "step":
        return f"let #{node} turn without end, until somebody stops it" if value else ""
    return f"move #{node} by {math.degrees(abs(value)):.0f} degrees" if abs(value) > FAR else ""
