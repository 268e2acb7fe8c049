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
    both_limits,
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
    from collections.abc import Mapping, Sequence

    from motorbus.core.family import Family

ORDERS: Final[Mapping[str, tuple[str, str]]] = {
    "velocity": ("set_velocity", "velocity"),
    "duty": ("set_duty", "load"),
    "current": ("set_current", "current"),
    "step": ("step", "position"),
}
"""Word of an order -> the verb that gives it, and the quantity of its value."""


@app.command(
    usage="Usage: motorbus feetech mode BUS#ID [MODE] [OPTIONS]",
    help_epilogue="""STS and newer SMS have position, velocity, pwm and step, old SMS all but step,
HLS position, velocity and current, SCS position and pwm. On SCS servos pwm is
both limits 0, and position needs --low and --high. Without MODE it says what
the servo heeds, and what would keep it from obeying an order: a torque limit
of 0, a goal torque of 0, limits without a way between them, an alarm that lets
its torque drop.

Examples:

    motorbus feetech mode feetech:/dev/ttyACM0#3
    motorbus feetech mode feetech:/dev/ttyACM0#3 velocity --yes
    motorbus feetech mode feetech:COM7#2 position --low 0.4 --high 5 --yes
    motorbus feetech mode feetech:/dev/ttyACM0#3 step --dry-run""",
)
def mode(
    device_: Device,
    mode_: Annotated[
        Literal["position", "velocity", "pwm", "step", "current"] | None, Parameter(name="MODE")
    ] = None,
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
    one_of_ours(device_)
    limits = both_limits(low, high)
    if not mode_:
        _only_read(limits, dry_run)

    def change(one: Servo) -> dict[str, Any] | None:
        if mode_:
            one.set_mode(mode_, limits=limits)
        return None if dry_run else _heeds(one)

    def consent(one: Servo) -> str:
        return f"put #{one.node} into {mode_} mode, for good, and let it go limp" if mode_ and not yes else ""

    node, told = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if told is not None:
        output.document("motorbus.feetech.mode/1", {"id": node, **told})
        heeded = told["mode"] or f"{told['code']}, which is not documented"
        rows = [("mode", heeded), ("lock", told["lock"])]
        output.table(f"#{node}", ["", ""], rows + [("blocked", words) for words in told["blockers"]])
    return Exit.OK


def _only_read(limits: tuple[float, float] | None, dry_run: bool) -> None:
    reads_only(dry_run)
    if limits:
        raise RequestError("limits without a mode", expected="MODE, as position", advice="nothing was sent")


def _heeds(one: Servo) -> dict[str, Any]:
    blockers = _blockers(one)
    locked = one.read_raw("lock")["lock"]
    assert one.table is not None
    assert one.settings is not None
    heeded = one.known_mode
    return {
        "mode": heeded.value if heeded else None,
        "code": one.settings.mode_code,
        "lock": one.table["lock"].choices.get(locked, str(locked)).partition(":")[0],
        "blockers": blockers,
    }


@app.command(
    usage="Usage: motorbus feetech drive BUS#ID ORDER=VALUE [OPTIONS]",
    help_epilogue="""ORDER is velocity, duty, current (HLS) or step, each in the mode for it:
`motorbus feetech mode` sets the mode, `motorbus torque on` the torque, which
comes on at rest. What turns without end needs --yes, and so does a step of
more than 180 degrees; `motorbus stop` or an order of 0 ends it. Ends with exit
code 1 and the reason where a setting keeps the servo from obeying. What a limp
servo was told is forgotten when its torque comes on: nothing jumps.

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
    one_of_ours(device_)
    name, verb, quantity, value = _order(order)
    given = _given(velocity=velocity, acceleration=acceleration, current=current)

    def go(one: Servo) -> list[str]:
        takes(one, verb, given)
        rehearsal = Servo(dry.DryBus(one.bus), one.node)  # type: ignore[arg-type]
        what = _far(one.node, name, value)
        rehearse = partial(getattr(rehearsal, verb), value, **given)
        consent_to(what, output, yes=yes or dry_run or not what, rehearse=rehearse)
        getattr(one, verb)(value, **given, **({"wait": False} if dry_run and verb == "step" else {}))
        return [] if dry_run or value == 0 else _blockers(one)

    node, said = on_servo(device_, options, output, go, dry_run=dry_run)
    if not dry_run:
        told = {"id": node, "order": name, "value": value, "blockers": said}
        output.document("motorbus.feetech.drive/1", told)
        if said:
            raise _powerless(node, order, said)
        output.text(f"#{node}: {name} {units.show(value, quantity)}")
    return Exit.OK


def _order(text: str) -> tuple[str, str, str, float]:
    """Its word, the verb that gives it, and the quantity and number of its value."""
    ((name, said),) = assigned([text], ORDERS).items()
    verb, quantity = ORDERS[name]
    return name, verb, quantity, units.parse(said, quantity)


def _given(**texts: str) -> dict[str, float]:
    """Those bounds that were said, each by its quantity."""
    return {name: units.parse(text, name) for name, text in texts.items() if text}


def _blockers(one: Servo) -> list[str]:
    family: Family = one.bus.family  # type: ignore[attr-defined]
    return [shell_words(words, family) for words in one.blockers()]


def _powerless(node: int, order: str, said: Sequence[str]) -> MotionError:
    return MotionError(
        f"#{node} took the order {order}, and will not obey it: {'; '.join(said)}",
        advice="mend that, then give the order again, for torque comes on at rest; `motorbus feetech mode` says this "
        "without an order",
        node=node,
    )


def _far(node: int, order: str, value: float) -> str:
    """What somebody must agree to before this order, "" for nothing."""
    if order != "step":
        return f"let #{node} turn without end, until somebody stops it" if value else ""
    return f"move #{node} by {math.degrees(abs(value)):.0f} degrees" if abs(value) > FAR else ""
