"""`motorbus feetech duplicates`: do two servos share an id, as far as listening can tell?"""

from __future__ import annotations

from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.servo import BusOption, Device, on_servo
from motorbus.cli.parameters import Silent
from motorbus.core.steps import Progress
from motorbus.families.feetech import driver
from motorbus.families.feetech.driver.sharing import POLLS

if TYPE_CHECKING:
    from motorbus.cli.output import Output


@app.command(
    usage="Usage: motorbus feetech duplicates BUS#ID [OPTIONS]",
    help_epilogue="""Reads one id many times, and listens for answers that are garbled, come twice,
or tell other settings. Two servos with the same settings that stand alike and
answer in the same moment look like one: only connecting one at a time rules
them out. Ends with exit code 1 when two are suspected.

Examples:

    motorbus feetech duplicates feetech:/dev/ttyACM0#1
    motorbus feetech duplicates feetech:/dev/ttyACM0#1 --polls 1000 --json""",
)
def duplicates(device_: Device, /, *, polls: int = POLLS, output: Silent, **options: BusOption) -> Exit:
    """Find out whether two servos share an id.

    Parameters
    ----------
    polls
        How often to ask at most.
    """
    node, seen = on_servo(device_, options, output, lambda servo: _asked(servo, polls, output))
    assert seen is not None
    output.document("motorbus.feetech.duplicates/1", {"suspected": seen.suspected, **seen._asdict()})
    if seen.suspected:
        output.text(f"two servos seem to have the id {node}: {seen.evidence}")
        output.note("connect one servo at a time; noise on the line, or a loose cable, looks alike")
        return Exit.FAILURE
    output.text(f"no second servo was seen at {node}: {seen.evidence}")
    output.note("two servos with equal settings, pose and timing look like one")
    return Exit.OK


def _asked(servo: driver.Servo, polls: int, output: Output) -> driver.ScanWarning:
    bus = servo.bus
    with output.progress("asking") as bar:

        def listen(event: object) -> None:
            if isinstance(event, Progress):
                bar.advance(event.done, event.total, event.what)

        return bus.run(driver.duplicates(servo, polls), report=listen)  # type: ignore[call-arg]
