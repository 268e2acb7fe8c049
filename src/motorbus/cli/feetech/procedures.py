"""`motorbus feetech clear-turns|recover-overload`: what takes several steps, each of which must be the right one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import BusOption, Device, facts, on_servo, one_of_ours
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.wording import shell_words
from motorbus.core import units

if TYPE_CHECKING:
    from motorbus.families.feetech.driver import Servo


@app.command(
    usage="Usage: motorbus feetech clear-turns BUS#ID [OPTIONS]",
    help_epilogue="""Instruction 0x0A, which some SDKs call reset; `factory-restore` is 0x06 and
something else. HLS and brushless ST servos obey it; an STS3215 with firmware
3.10 is silent, and a power cycle forgets its turns. Home the machine again
before it moves.

Examples:

    motorbus feetech clear-turns feetech:/dev/ttyACM0#3 --yes
    motorbus feetech clear-turns feetech:/dev/ttyACM0#3 --dry-run""",
)
def clear_turns(
    device_: Device,
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Let a servo forget the turns it has counted; it goes limp.

    Parameters
    ----------
    yes
        Do not ask before it goes limp and its zero is lost.
    """

    def consent(one: Servo) -> str:
        return "" if yes else f"let #{one.node} go limp and forget its turns, so that it must be homed"

    node, here = on_servo(
        device_, options, output, lambda one: one.clear_turns(), dry_run=dry_run, consent=consent
    )
    if here is not None and not dry_run:
        output.document("motorbus.feetech.clear-turns/1", {"id": node, "position": here})
        output.text(f"#{node} stands at {units.show(here, 'position')} now; home it before it moves")
    return Exit.OK


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
