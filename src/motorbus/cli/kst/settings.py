"""`motorbus kst reports|mid-point|limits|reverse`: what newer firmware lets one set; the manual has none of it."""

from __future__ import annotations

from operator import methodcaller
from typing import Annotated, Literal

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.kst.servo import BusOption, Device, app, named, on_servo, one_of_ours, reads_only
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.core import units
from motorbus.errors import RequestError


@app.command(
    usage="Usage: motorbus kst reports on|off BUS#ID [OPTIONS]",
    help_epilogue="""Not in the manual; a profile without it refuses. By the profile xqpower the
same start lets the servo move, and the stop makes it ignore positions.

Examples:

    motorbus kst reports on kst:can://slcan/dev/ttyACM0#1 --profile kst-ext
    motorbus kst reports on kst:sim,profile=kst-ext#1 --interval 10ms
    motorbus kst reports off kst:sim,profile=kst-ext#1""",
)
def reports(
    switch: Literal["on", "off"],
    device_: Device,
    /,
    *,
    interval: str = "",
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Let a servo report its position by itself, or no more.

    Parameters
    ----------
    switch
        on or off
    interval
        How often, as 10ms; as the servo is set when left out.
    """
    one_of_ours(device_)
    seconds = units.parse(interval, "time") if interval else None
    if switch == "on":
        node, _ = on_servo(device_, options, output, lambda one: one.start_reports(seconds), dry_run=dry_run)
    else:
        node, _ = on_servo(device_, options, output, lambda one: one.stop_reports(), dry_run=dry_run)
    if not dry_run:
        output.document(
            "motorbus.kst.reports/1", {"id": node, "reports": switch == "on", "interval": seconds}
        )
        output.text(f"reports of {named(node)} switched {switch}; nobody acknowledges that")
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst mid-point BUS#ID [OPTIONS]",
    help_epilogue="""Keep clear: what becomes of the present target, which then lies elsewhere, is
written nowhere. Not in the manual; a profile without it refuses.

Examples:

    motorbus kst mid-point kst:sim,profile=kst-ext#1 --yes
    motorbus kst mid-point kst:sim,profile=kst-ext#1 --dry-run""",
)
def mid_point(
    device_: Device,
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Make the present position of a servo its zero, and save that.

    Parameters
    ----------
    yes
        Do not ask before the zero is moved for good.
    """
    _, _, (node,) = one_of_ours(device_)
    consent = "" if yes else f"make the present position of {named(node)} its zero, for good"
    _, here = on_servo(
        device_, options, output, lambda one: one.set_mid_point(), dry_run=dry_run, consent=consent
    )
    if not dry_run:
        output.document("motorbus.kst.mid-point/1", {"id": node, "position": here})
        output.text(
            f"{named(node)} calls this place {units.show(here, 'position')} now, and has been told to save it"
        )
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst limits BUS#ID [LOW HIGH] [OPTIONS]",
    help_epilogue="""Read back, saved, and read back again. Not in the manual; a profile without it
refuses.

Examples:

    motorbus kst limits kst:sim,profile=kst-ext#1
    motorbus kst limits kst:sim,profile=kst-ext#1 -45deg 45deg --yes""",
)
def limits(
    device_: Device,
    low: Annotated[str, Parameter(name="LOW", allow_leading_hyphen=True)] = "",
    high: Annotated[str, Parameter(name="HIGH", allow_leading_hyphen=True)] = "",
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read the travel limits of a servo, or set and save them.

    Parameters
    ----------
    low
        Lowest position, at most 0, in rad or as -45deg.
    high
        Highest position, at least 0.
    yes
        Do not ask before the limits are written for good.
    """
    _, _, (node,) = one_of_ours(device_)
    if bool(low) != bool(high):
        raise RequestError("one limit alone", expected="both, as -45deg 45deg", advice="nothing was sent")
    if low:
        bounds = units.parse(low, "position"), units.parse(high, "position")
        consent = "" if yes else f"set the travel limits of {named(node)} for good"
        set_ = methodcaller("set_travel_limits", *bounds)
        on_servo(device_, options, output, set_, dry_run=dry_run, consent=consent)
        if dry_run:
            return Exit.OK
    else:
        reads_only(dry_run)
        _, bounds = on_servo(device_, options, output, lambda one: one.travel_limits())
    output.document("motorbus.kst.limits/1", {"id": node, "low": bounds[0], "high": bounds[1]})
    output.table(f"#{node}", ["low", "high"], [[units.show(bound, "position") for bound in bounds]])
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst reverse BUS#ID [on|off] [OPTIONS]",
    help_epilogue="""Only the one known bit is changed, the others are written back as they were.
Some firmware undoes it at a restart: look again after one. Not in the manual;
a profile without it refuses.

Examples:

    motorbus kst reverse kst:sim,profile=kst-ext#1
    motorbus kst reverse kst:sim,profile=kst-ext#1 on --yes""",
)
def reverse(
    device_: Device,
    switch: Literal["on", "off"] | None = None,
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Say whether the sense of rotation of a servo is reversed, or reverse it.

    Parameters
    ----------
    switch
        on or off; left out, it is read.
    yes
        Do not ask before it is written for good.
    """
    _, _, (node,) = one_of_ours(device_)
    if switch:
        on = switch == "on"
        consent = "" if yes else f"switch the reverse bit of {named(node)} {switch} for good"
        set_ = methodcaller("set_reversed", on)
        on_servo(device_, options, output, set_, dry_run=dry_run, consent=consent)
        if dry_run:
            return Exit.OK
    else:
        reads_only(dry_run)
        _, on = on_servo(device_, options, output, lambda one: one.reversed())
    output.document("motorbus.kst.reverse/1", {"id": node, "reversed": on})
    output.text(f"{named(node)} turns {'in reverse' if on else 'as shipped'}")
    return Exit.OK
