"""`motorbus info`: what a device is, what bounds it, and with --registers all that it can be asked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import App, Parameter

from motorbus.cli import alarms
from motorbus.cli import registers as table_rows
from motorbus.cli.exits import Exit
from motorbus.cli.machine import axes_called
from motorbus.cli.output import Output
from motorbus.cli.target import device, face, id_shown, opened, table_of
from motorbus.core.register import Storage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.core.family import Family, Identity
    from motorbus.core.register import Register, RegisterMap
    from motorbus.errors import DeviceError

_OPEN: Final = (
    "note: its EEPROM lock is open, so every write to EEPROM is for good: "
    "`motorbus write BUS#ID lock=1` closes it"
)

app = App(
    name="info",
    help_epilogue="""Reads only. A device with unknown firmware is named as such and never written.
Limits and registers are the device's, in its own angles, also where it is
called by the name of an axis; the limits of the axis are in the machine file.

Examples:

    motorbus info feetech:/dev/ttyACM0#3
    motorbus info feetech:/dev/ttyACM0#3 --registers
    motorbus info feetech:sim#1 --json""",
)


@app.default
def info(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *,
    registers: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Say what a device is: model, firmware, limits, registers, and whether its EEPROM lock is open.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3, or an axis
    registers
        Read every register and show address, value, unit, storage and access.
    options
        Any option of the bus string, as a flag.
    """
    bus, family, (node,) = device(device_)
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        identity: Identity = one.identify()
        table = table_of(one)
        entries = _entries(table, everything=registers)
        lock = [table["lock"]] if "lock" in table else []
        wanted = [*dict.fromkeys(entry.name for entry in (*entries, *lock))]
        values, refused = table_rows.read_each(one, wanted)
        entries = [entry for entry in entries if entry.name in values]
        told = alarms.in_words(one)
    locked = {entry.name: _word(entry, int(values[entry.name])) for entry in lock if entry.name in values}
    _show(identity, family, table_rows.facts(one, entries, values), registers, output, told, locked, refused)
    if axis := axes_called((device_,)).get((bus, node)):
        output.note(f"note: all of it is what the device of {axis} tells, in its own angles")
    return Exit.OK


def _entries(table: RegisterMap, *, everything: bool) -> list[Register]:
    readable = [entry for entry in table.values() if entry.readable]
    return readable if everything else [entry for entry in readable if _bounds(entry)]


def _bounds(entry: Register) -> bool:
    """A row that keeps the device within something: its minima, maxima and limits."""
    return entry.storage is Storage.EEPROM and bool({"min", "max", "limit"} & set(entry.name.split("_")))


def _word(entry: Register, raw: int) -> str:
    """What this value is called, without what it comes to."""
    return entry.choices.get(raw, str(raw)).partition(":")[0]


def _show(
    identity: Identity,
    family: Family,
    rows: Sequence[dict[str, Any]],
    registers: bool,
    output: Output,
    told: Sequence[str] = (),
    locked: Mapping[str, str] | None = None,
    refused: Mapping[str, DeviceError] | None = None,
) -> None:
    known = {"id": identity.node, "model": identity.model, "firmware": identity.firmware}
    named = {**known, "table": identity.table, **identity.details, **(locked or {})}
    title = "registers" if registers else "limits"
    output.document(
        "motorbus.info/1", {**named, title: rows, "alarms": list(told), **table_rows.refusals(refused or {})}
    )
    table = identity.table or "unknown firmware: read only"
    words = {**named, "id": id_shown(identity.node, family), "table": table}
    output.table(identity.model, ["", ""], [*words.items(), *(("alarm", one) for one in told)])
    if rows:
        output.text("")
        table_rows.show(title.capitalize(), rows, output, full=registers)
    for error in (refused or {}).values():
        output.note(f"note: {error.summary}")
    if "open" in (locked or {}).values():
        output.note(_OPEN)
