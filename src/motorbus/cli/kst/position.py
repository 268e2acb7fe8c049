"""`motorbus kst position|status|version`: what a servo tells, and where it is to go. Manual, commands 5 to 8."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from cyclopts import Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to_ways
from motorbus.cli.exits import Exit
from motorbus.cli.kst.servo import BusOption, Device, app, on_servo, one_of_ours, reads_only
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.core import units
from motorbus.families.kst import RawStatus, Servo


@app.command(
    usage="Usage: motorbus kst position BUS#ID [VALUE] [OPTIONS]",
    help_epilogue="""Positions are in rad, or with a unit: 90deg. They are rounded to the servo's
tenth of a degree as decimals are, halves away from zero. Out of range nothing
is sent.

Examples:

    motorbus kst position kst:can://slcan/dev/ttyACM0#0x25
    motorbus kst position kst:can://slcan/dev/ttyACM0#0x25 10.9deg
    motorbus kst position kst:sim,ids=0x25#0x25 -30deg --wait
    motorbus kst position kst:sim,ids=0x25#0x25 90deg --dry-run""",
)
def position(
    device_: Device,
    value: Annotated[str, Parameter(name="VALUE", allow_leading_hyphen=True)] = "",
    /,
    *,
    wait: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read the position of a servo, or send it to one.

    Parameters
    ----------
    value
        Where it shall go; left out, its position is read.
    wait
        Return when it is there; else as soon as it has acknowledged.
    yes
        Do not ask before a way of more than 180 degrees.
    """
    one_of_ours(device_)
    if not value:
        reads_only(dry_run)
        node, here = on_servo(device_, options, output, lambda servo: servo.position())
        output.document("motorbus.kst.position/1", {"id": node, "position": here})
        output.text(units.show(here, "position"))
        return Exit.OK
    goal = units.parse(value, "position")

    def go(servo: Servo) -> float:
        rehearsal = Servo(dry.DryBus(servo.bus), servo.node)  # type: ignore[arg-type]
        rehearse = partial(rehearsal.move, goal, wait=False)
        consent_to_ways([(servo, goal)], output, yes=yes or dry_run, rehearse=rehearse)
        servo.move(goal, wait=wait and not dry_run)
        return goal if dry_run else servo.position()

    node, here = on_servo(device_, options, output, go, dry_run=dry_run)
    if not dry_run:
        output.document("motorbus.kst.position/1", {"id": node, "goal": goal, "position": here})
        goal_shown, here_shown = (units.show(angle, "position") for angle in (goal, here))
        output.table("", ["id", "goal", "position"], [(node, goal_shown, here_shown)])
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst status BUS#ID [OPTIONS]",
    help_epilogue="""By the profile `kst`, the manual, a status is two bytes that nothing explains,
read by the very frame that reads the position. Other profiles tell current and
temperature.

Examples:

    motorbus kst status kst:can://slcan/dev/ttyACM0#0x25
    motorbus kst status kst:sim,ids=0x25,profile=kst-ext#0x25""",
)
def status(device_: Device, /, *, output: Silent, **options: BusOption) -> Exit:
    """Read the status of a servo."""
    node, told = on_servo(device_, options, output, lambda servo: servo.status())
    output.document("motorbus.kst.status/1", {"id": node, **told._asdict()})
    if isinstance(told, RawStatus):
        output.table(f"#{node}", ["X1", "X2"], [(f"0x{told.x1:02X}", f"0x{told.x2:02X}")])
        output.note(f"warning: {told.warning}")
    else:
        shown = units.show(told.current, "current"), units.show(told.temperature, "temperature")
        output.table(f"#{node}", ["current", "temperature"], [shown])
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst version BUS#ID [OPTIONS]",
    help_epilogue="""Examples:

    motorbus kst version kst:can://slcan/dev/ttyACM0#0x25
    motorbus kst version kst:sim,ids=0x25#0x25 --json""",
)
def version(device_: Device, /, *, output: Silent, **options: BusOption) -> Exit:
    """Read the firmware version of a servo."""
    node, text = on_servo(device_, options, output, lambda servo: servo.version())
    output.document("motorbus.kst.version/1", {"id": node, "version": text})
    output.text(text)
    return Exit.OK
