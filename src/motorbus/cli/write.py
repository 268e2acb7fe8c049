"""`motorbus write`: registers by name. Everything is checked before anything is sent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from motorbus import families
from motorbus.cli import quantity
from motorbus.cli.exits import Exit, NeedsConsent
from motorbus.cli.info import facts
from motorbus.cli.output import Output
from motorbus.cli.read import table_of
from motorbus.cli.target import device, face, opened, rehearsal, target
from motorbus.core.entry import Entry, Storage, Value
from motorbus.core.operation import Effect
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.core.entry import Table

app = App(
    name="write",
    usage="Usage: motorbus write BUS#ID NAME=VALUE... [OPTIONS]",
    help_epilogue="""Values are in the unit of the register, or with one of their own: 90deg, 500ms.
Registers kept in EEPROM need --yes; the device goes limp while they are written.
With --raw the numbers are what stands on the wire; a register that moves the
device then needs --expert too. --dry-run reads, shows each frame that would
change something, explained, and sends none of those.

Examples:

    motorbus write feetech:sim#1 goal_position=90deg
    motorbus write feetech:sim#1 max_temperature=65 --yes
    motorbus write feetech:sim#1 acceleration=20 --raw
    motorbus write feetech:sim#1 torque_limit=50% --dry-run""",
)


@app.default
def write(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *assignments: Annotated[str, Parameter(name="NAME=VALUE", allow_leading_hyphen=False)],
    raw: Annotated[bool, Parameter(negative="")] = False,
    expert: Annotated[bool, Parameter(negative="")] = False,
    yes: Annotated[bool, Parameter(negative="")] = False,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Write registers of a device.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3
    assignments
        Registers by name, and what they shall hold.
    raw
        The values are raw.
    expert
        Allow raw values in registers that move the device.
    yes
        Do not ask before writing to EEPROM.
    dry_run
        Show the frames that would be sent, and send none of them.
    options
        Any option of the bus string, as a flag.
    """
    bus, node = device(device_)
    typed = _typed(target(device_).family, assignments, raw)
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        table = table_of(one)
        orders = [(table[name], _value(one, table[name], text, raw)) for name, text in typed.items()]
        _permit(orders, output, raws=_raws(typed, raw), expert=expert, yes=yes or dry_run)
        values = {entry.name: value for entry, value in orders}
        if dry_run:
            with rehearsal(opening, output) as dry:
                face(dry, node).write(**values)
            return Exit.OK
        one.write(**values)
        _show(one, orders, output)
    return Exit.OK
