"""`motorbus feetech recover-overload`: switch torque on again after an overload."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import BusOption, Device, facts, on_servo, one_of_ours
from motorbus.cli.parameters import DryRun, Silent
from motorbus.cli.wording import shell_words

if TYPE_CHECKING:
    pass


@app.command(
    usage="Usage: motorbus feetech recover-overload BUS#ID [OPTIONS]",
    help_epilogue="""Torque off, one second, the goal to where it stands, torque on: nothing jumps,
but an arm sags meanwhile. Ends with exit code 7 and a limp servo where the
alarm stays: then only a power cycle helps. Does nothing where no overload or
over-current alarm is set.

Examples:

    motorbus feetech recover-overload feetech:/dev/ttyACM0#3
    motorbus feetech recover-overload feetech:/dev/ttyACM0#3 --dry-run""",
)
def recover_overload(
    device_: Device, /, *, dry_run: DryRun = False, output: Silent, **options: BusOption
) -> Exit:
    """Bring a servo back whose overload protection has tripped."""
    family = one_of_ours(device_).family
    node, told = on_servo(device_, options, output, lambda one: one.recover_overload(), dry_run=dry_run)
    if told is None or (dry_run and told.tripped):
        return Exit.OK
    if not dry_run:
        output.document("motorbus.feetech.recover-overload/1", {"id": node, **facts(told)})
    if told.tripped:
        output.text(f"#{node} holds where it stands; the alarm {' and '.join(told.tripped)} is gone")
    else:
        output.text(f"#{node} has no overload to recover from; nothing was done")
    for words in told.remaining:
        output.note(f"warning: {shell_words(words, family)}")
    return Exit.OK
