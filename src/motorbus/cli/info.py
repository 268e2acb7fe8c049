"""`motorbus info`: what a device is, what bounds it, and with --registers all it can be asked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli import quantity
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.target import device, face, opened
from motorbus.core.entry import Storage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from motorbus.core.entry import Entry, Table, Value
    from motorbus.core.family import Identity

app = App(
    name="info",
    help_epilogue="""Reads only. A device with unknown firmware is named as such and never written.

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
    """Say what a device is: model, firmware, limits, registers.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3
    registers
        Read every register and show address, value, unit, storage and access.
    options
        Any option of the bus string, as a flag.
    """
    bus, node = device(device_)
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        identity = one.identify()
        table = opening.family.tables.get(identity.table)
        entries = _entries(table, everything=registers)
        values = one.read(*(entry.name for entry in entries)) if entries else {}
        rows = [facts(entry, values[entry.name]) for entry in entries]
        _show(identity, rows, registers, output)
    return Exit.OK


def _entries(table: Table | None, *, everything: bool) -> list[Entry]:
    readable = [entry for entry in (table or {}).values() if entry.readable]
    return readable if everything else [entry for entry in readable if _bounds(entry)]


def _bounds(entry: Entry) -> bool:
    """A row that keeps the device within something: its minima, maxima and limits."""
    return entry.storage is Storage.EEPROM and bool({"min", "max", "limit"} & set(entry.name.split("_")))


def facts(entry: Entry, value: Value) -> dict[str, object]:
    """One register and what it holds, as plain data."""
    raw = entry.to_raw(value)
    return {
        "name": entry.name,
        "address": entry.address,
        "value": value,
        "unit": entry.unit,
        "raw": raw,
        "meaning": quantity.meaning(entry, raw),
        "storage": entry.storage.value,
        "access": entry.access.value,
    }


def _show(identity: Identity, rows: Sequence[dict[str, object]], registers: bool, output: Output) -> None:
    known = {"id": identity.node, "model": identity.model, "firmware": identity.firmware}
    named = {**known, "table": identity.table, **identity.details}
    output.document("motorbus.info/1", {**named, "registers" if registers else "limits": rows})
    words = {**named, "table": identity.table or "unknown firmware: read only"}
    output.table(identity.model, ["", ""], words.items())
    if rows:
        shown = [_row(row) for row in rows]
        output.table("Registers" if registers else "Limits", COLUMNS, shown)


COLUMNS = ("register", ">address", "value", ">raw", "meaning", "storage", "access")


def _row(row: dict[str, object]) -> tuple[object, ...]:
    value = quantity.shown(row["value"], str(row["unit"]))  # type: ignore[arg-type]
    return (row["name"], row["address"], value, row["raw"], row["meaning"], row["storage"], row["access"])
