"""`motorbus feetech factory-restore`, and the group of commands of FEETECH servos."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import App, Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.parameters import DryRun, Flag
from motorbus.cli.target import Target, device, face, opened
from motorbus.errors import RequestError

if TYPE_CHECKING:
    pass

NAME: Final = "feetech"

app = App(name=NAME, help="What only feetech devices can do.", help_epilogue="")

Silent = Annotated[Output, Parameter(parse=False)]


def _ours(found: Target) -> Target:
    if found.family.name != NAME:
        raise RequestError(f"{found.bus} is no {NAME} bus", advice="nothing was sent")
    return found


@app.command(
    usage="Usage: motorbus feetech factory-restore BUS#ID [OPTIONS]",
    help_epilogue="""Examples:

    motorbus feetech factory-restore feetech:/dev/ttyACM0#3 --dry-run
    motorbus feetech factory-restore feetech:/dev/ttyACM0#3 --yes""",
)
def factory_restore(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Set a servo back as shipped; it goes limp, and keeps its id as a rule.

    Parameters
    ----------
    device_
        feetech:PORT#ID, as feetech:/dev/ttyACM0#3
    yes
        Do not ask before everything in EEPROM is overwritten.
    options
        Any option of the bus string, as a flag.
    """
    bus, _, (node,) = _ours(device(device_))
    with opened(bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        what = f"overwrite all settings of #{node}, and let it go limp"
        consent_to(what, output, yes=yes or dry_run, rehearse=face(rehearsal, node).factory_restore)
        found = face(rehearsal if dry_run else opening, node).factory_restore()
    if dry_run:
        dry.show(rehearsal, output)
        return Exit.OK
    facts = {"id": node, "found": found.node, "baud": found.rate}
    output.document("motorbus.feetech.factory-restore/1", facts)
    output.text(f"#{node} is as shipped; it answers as #{found.node} at {found.rate} bit/s")
    return Exit.OK
