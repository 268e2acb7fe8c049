"""`motorbus set-id`: one device gets another id, guarded, journalled and verified."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.identity import address, agreed, carried_out, id_said, parse_timeout, rehearsed
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import device, face, id_shown, offers, opened, takes

app = App(
    name="set-id",
    usage="Usage: motorbus set-id BUS#ID NEW [OPTIONS]",
    help_epilogue="""Connect one new device at a time: two that share an id cannot always be told
from one. Refused when two seem to have the old id, or somebody has the new
one. A device with torque goes limp. What is cut off in the middle is ended by
`motorbus recover`; a KST servo asks for a power cycle.

Examples:

    motorbus set-id feetech:/dev/ttyACM0#1 7
    motorbus set-id feetech:/dev/ttyACM0#1 7 --yes
    motorbus set-id kst:can://slcan/dev/ttyACM0#0x25 0x26 --timeout 60s
    motorbus set-id feetech:/dev/ttyACM0#1 7 --dry-run""",
)


@app.default
def set_id(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    new: Annotated[str, Parameter(name="NEW")],
    /,
    *,
    timeout: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Give a device another id, for good.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#1
    new
        Its new id, which nobody may have.
    timeout
        How long to wait for a power cycle, where one is needed; 120s when left out.
    yes
        Do not ask before its memory is written.
    options
        Any option of the bus string, as a flag.
    """
    bus, family, (node,) = device(device_)
    offers(family, "set_id")
    wanted = id_said(new)
    family.devices.blocking(None, wanted)  # raises when it is no id
    extra = parse_timeout(timeout)
    with opened(bus, options, output) as opening:
        takes(face(opening, node), "set_id", extra)
        if dry_run:
            rehearsed(opening, [node], "set_id", wanted, extra, output)
            return Exit.OK
        if not yes:
            what = f"give #{id_shown(node, family)} the id {id_shown(wanted, family)} for good"
            agreed(opening, node, "set_id", wanted, extra, what, output)
        found = carried_out(opening, node, "set_id", wanted, output=output, **extra)
    there = address(bus, family, node=found.node)
    output.document("motorbus.set-id/1", {"id": node, "new": found.node, "address": there})
    output.text(f"#{id_shown(node, family)} is #{id_shown(found.node, family)} now: {there}")
    return Exit.OK
