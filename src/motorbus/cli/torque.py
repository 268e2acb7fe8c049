"""`motorbus torque`: the power stage on or off. On never jumps; off visits everyone whatever happens."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import App, Parameter

from motorbus.cli.each import each
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output

app = App(
    name="torque",
    usage="Usage: motorbus torque on|off BUS[#ID]... [OPTIONS]",
    help_epilogue="""`on` first makes the goal the present position, so nothing jumps. `off` visits
every device whatever happens to some, and lets an arm sag.

Examples:

    motorbus torque on feetech:/dev/ttyACM0#3
    motorbus torque off feetech:/dev/ttyACM0""",
)


@app.default
def torque(
    switch: Literal["on", "off"],
    /,
    *devices: Annotated[str, Parameter(name="BUS#ID")],
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Switch the power stage on or off.

    Parameters
    ----------
    switch
        on or off
    devices
        FAMILY:PORT for every device that answers, or FAMILY:PORT#ID for some.
    dry_run
        Read as usual; show the frames that would change something, and send none of those.
    options
        Any option of the bus string, as a flag.
    """
    verb = "enable_torque" if switch == "on" else "disable_torque"
    return each(f"torque {switch}", verb, devices, options, output, dry_run=dry_run)
