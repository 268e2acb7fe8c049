"""`motorbus feetech second-id`: whose writes an HLS servo obeys besides those to its own id."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import BusOption, Device, on_servo, one_of_ours, reads_only
from motorbus.cli.identity import id_said, said_of_others
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.families.feetech.driver import Servo

_SCHEMA = "motorbus.feetech.second-id/1"


@app.command(
    usage="Usage: motorbus feetech second-id BUS#ID [NEW] [OPTIONS]",
    help_epilogue="""HLS servos. A servo obeys every write to its second id as well, and answers to
none of them, so an id that another servo has is refused. Its own id means that
it has no other. `set-id` takes a second id along that is the old id.

Examples:

    motorbus feetech second-id feetech:/dev/ttyACM0#7
    motorbus feetech second-id feetech:/dev/ttyACM0#7 7 --yes
    motorbus feetech second-id feetech:/dev/ttyACM0#7 100 --among 1-20 --yes
    motorbus feetech second-id feetech:/dev/ttyACM0#7 7 --dry-run""",
)
def second_id(
    device_: Device,
    new: Annotated[str, Parameter(name="NEW")] = "",
    /,
    *,
    force: Flag = False,
    among: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Say which second id a servo has, or give it another one.

    Parameters
    ----------
    new
        Its new second id; left out, it is read.
    force
        It may be one that other servos have, which all obey it then.
    among
        Ids that other servos on this bus may have, as 1-20; every id is asked when left out.
    yes
        Do not ask before its memory is written.
    """
    one_of_ours(device_)
    extra = said_of_others(among, "")
    if not new:
        reads_only(dry_run)
        if force or extra:
            raise RequestError("which second id shall it have?", expected="NEW", advice="nothing was sent")
        node, now = on_servo(device_, options, output, lambda one: one.second_id())
    else:
        wanted = id_said(new)

        def change(one: Servo) -> int:
            return one.set_second_id(wanted, force=force, **extra)  # type: ignore[arg-type]

        def consent(one: Servo) -> str:
            return "" if yes else f"give #{one.node} the second id {wanted} for good"

        node, now = on_servo(device_, options, output, change, dry_run=dry_run, consent=consent)
    if not dry_run:
        output.document(_SCHEMA, {"id": node, "second_id": now})
        output.text(f"#{node} obeys writes to {now}" + (", its own id, alone" if now == node else ", too"))
    return Exit.OK
