"""`motorbus kst node-id|bit-rate|save`: commands 1 to 4 of the manual, each by itself. `provision` does all of it.

What is written here is in force after a save and a restart only, and no command restarts these servos; so each says
what comes next.
"""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.kst.servo import BusOption, Device, app, named, on_servo, one_of_ours, reads_only
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.families.kst import Node
from motorbus.families.kst.profiles import bit_rate_code


@app.command(
    usage="Usage: motorbus kst node-id BUS#ID [NEW] [OPTIONS]",
    help_epilogue="""NEW is in force after `motorbus kst save` and a power cycle, and lost at a
power cycle without; until then the servo answers under its old id.
`motorbus kst provision` does all of it and verifies it.

Examples:

    motorbus kst node-id kst:can://slcan/dev/ttyACM0#0x25
    motorbus kst node-id kst:can://slcan/dev/ttyACM0#0x25 0x26 --yes
    motorbus kst node-id kst:sim,ids=0x25#0x25 0x26 --dry-run""",
)
def node_id(
    device_: Device,
    new: Annotated[str, Parameter(name="NEW")] = "",
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read the id that a servo has or will have, or give it another one.

    Parameters
    ----------
    new
        Its new id, 1 to 127; left out, the id is read.
    yes
        Do not ask before the id is written.
    """
    _, _, (old,) = one_of_ours(device_)
    if not new:
        reads_only(dry_run)
        _, found = on_servo(device_, options, output, lambda servo: servo.node_id())
        output.document("motorbus.kst.node-id/1", {"id": old, "reads_back": found})
        pending = "" if found == old else f"; it answers as {named(old)} until it is restarted"
        output.text(f"{named(found)}{pending}")
        return Exit.OK
    wanted = whole(new, "an id")
    Node(wanted)  # raises when it is no id
    consent = "" if yes else f"give {named(old)} the id {named(wanted)}"
    on_servo(device_, options, output, lambda one: one.set_node_id(wanted), dry_run=dry_run, consent=consent)
    if not dry_run:
        output.document("motorbus.kst.node-id/1", {"id": old, "new": wanted, "in_force": False, "next": NEXT})
        output.text(f"written: {named(old)} will be {named(wanted)}. {_next(device_)}")
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst bit-rate BUS#ID [RATE] [OPTIONS]",
    help_epilogue="""RATE is in bit/s, or as 500k. It is in force after `motorbus kst save` and a
power cycle, and lost at a power cycle without. The manual has no way to read
it; firmware that tells it all the same is believed.

Examples:

    motorbus kst bit-rate kst:can://slcan/dev/ttyACM0#0x25
    motorbus kst bit-rate kst:can://slcan/dev/ttyACM0#0x25 1000000 --yes
    motorbus kst bit-rate kst:sim,ids=0x25#0x25 250k --dry-run""",
)
def bit_rate(
    device_: Device,
    rate: Annotated[str, Parameter(name="RATE")] = "",
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read the bit rate that a servo will have, where it tells, or give it another one.

    Parameters
    ----------
    rate
        20k, 50k, 100k, 125k, 250k, 500k, 800k or 1000k; left out, the rate is read.
    yes
        Do not ask before the rate is written.
    """
    _, _, (node,) = one_of_ours(device_)
    if not rate:
        reads_only(dry_run)
        _, found = on_servo(device_, options, output, lambda servo: servo.bit_rate())
        output.document("motorbus.kst.bit-rate/1", {"id": node, "bitrate": found})
        output.text("not readable: the manual has no command for it" if found is None else f"{found} bit/s")
        return Exit.OK
    wanted = bits_per_second(rate)
    consent = "" if yes else f"give {named(node)} the bit rate {wanted} bit/s"
    on_servo(device_, options, output, lambda one: one.set_bit_rate(wanted), dry_run=dry_run, consent=consent)
    if not dry_run:
        facts = {"id": node, "new": wanted, "in_force": False, "next": NEXT}
        output.document("motorbus.kst.bit-rate/1", facts)
        output.text(f"written: {named(node)} will speak at {wanted} bit/s. {_next(device_)}")
    return Exit.OK


@app.command(
    usage="Usage: motorbus kst save BUS#ID [OPTIONS]",
    help_epilogue="""A save is not answered; what was saved shows after a power cycle only.

Examples:

    motorbus kst save kst:can://slcan/dev/ttyACM0#0x25 --yes
    motorbus kst save kst:sim,ids=0x25#0x25 --dry-run""",
)
def save(
    device_: Device,
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Keep id, bit rate, limits and function bits over power-off.

    Parameters
    ----------
    yes
        Do not ask before the memory is written.
    """
    _, _, (node,) = one_of_ours(device_)
    consent = "" if yes else f"save the settings of {named(node)}, where they survive power-off"
    on_servo(device_, options, output, lambda one: one.save(), dry_run=dry_run, consent=consent)
    if not dry_run:
        output.document("motorbus.kst.save/1", {"id": node, "sent": True, "confirmed": None})
        output.text(f"sent to {named(node)}, which does not answer that; a power cycle shows what was saved")
    return Exit.OK


NEXT = ["save", "power-cycle"]


def _next(device_: str) -> str:
    return f"In force after `motorbus kst save {device_}` and a power cycle; lost at one without"


def whole(text: str, what: str) -> int:
    """A whole number, decimal or 0x. Raises RequestError."""
    try:
        return units.whole(text)
    except ValueError:
        raise RequestError(
            f"{text!r} is not {what}", expected="a whole number", advice="nothing was sent"
        ) from None


def bits_per_second(text: str) -> int:
    """500000, 500k or 1M. Raises RequestError for a rate that these servos cannot have."""
    rate = units.rate(text)
    bit_rate_code(rate)
    return rate
