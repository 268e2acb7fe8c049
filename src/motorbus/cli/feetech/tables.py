"""`motorbus feetech registers|models`: all that is known of these servos, with its source. Opens no port."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.cli.exits import Exit
from motorbus.cli.feetech.orders import Silent, app
from motorbus.core.register import Coding
from motorbus.errors import RequestError
from motorbus.families.feetech.table import MODELS, TABLES, model_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from motorbus.core.register import Register, RegisterMap
    from motorbus.families.feetech.table import Model

_COLUMNS = (
    *(">address", "register", ">bytes", "storage", "access", "sign", "range", ">default", "unit", "effect"),
    *("source", ""),
)


@app.command(
    help_epilogue="""Which of the six maps a servo has is told by its firmware and byte order, as
`motorbus info` shows. With --json it is a database of all maps, with the
source of each row. What sources disagree about, or none confirms, is marked
"in doubt" in the table, and in the database by "conflict", which says who says
what and what was chosen.

Examples:

    motorbus feetech registers
    motorbus feetech registers --map hls
    motorbus feetech registers --json > feetech-registers.json"""
)
def registers(*, map: str = "", output: Silent) -> Exit:
    """Show every register of a map: what it means, and who says so.

    Parameters
    ----------
    map
        sts, smbl, smcl, scs, scs2 or hls; all of them when left out.
    """
    wanted = [_table(map)] if map else list(TABLES.values())
    output.document("motorbus.feetech.registers/1", database(wanted))
    for table in wanted:
        output.table(f"{table.name}: {table.title}", _COLUMNS, [_cells(row) for row in table.values()])
        output.text("")
        for row in table.values():
            if remarks := "; ".join([*meanings(row), *filter(None, [row.note])]):
                output.text(f"{row.address} {row.name}: {remarks}")
            if row.conflict:
                output.text(f"{row.address} {row.name}, in doubt: {row.conflict}")
        output.text("")
    return Exit.OK


@app.command(
    help_epilogue="""A number is the name and the byte order of a servo. Only its firmware tells the
map, and neither voltage class nor gear ratio can be read at all.

Examples:

    motorbus feetech models
    motorbus feetech models --json"""
)
def models(*, output: Silent) -> Exit:
    """List the models that are known by their number."""
    known = [_model(major, minor, model) for (major, minor), model in MODELS.items()]
    output.document("motorbus.feetech.models/1", {"models": known})
    columns = (">number", "major.minor", "model", "usual maps", "byte order", ">counts", "over", "note")
    output.table("", columns, [_model_cells(one) for one in known])
    return Exit.OK


def database(tables: list[RegisterMap]) -> dict[str, Any]:
    """These maps as plain data: everything that their rows say."""
    return {"maps": [_map(table) for table in tables]}


def _table(name: str) -> RegisterMap:
    if name.lower() not in TABLES:
        raise RequestError(f"there is no register map {name!r}", expected=f"one of {', '.join(TABLES)}")
    return TABLES[name.lower()]


def _map(table: RegisterMap) -> dict[str, Any]:
    (order,) = {row.order for row in table.values()}
    return {
        "name": table.name,
        "title": table.title,
        "byte_order": order,
        "registers": [_facts(row) for row in table.values()],
    }


def _facts(row: Register) -> dict[str, Any]:
    return {
        "name": row.name,
        "address": row.address,
        "size": row.size,
        "storage": row.storage.value,
        "access": row.access.value,
        "coding": row.coding.value,
        "sign_bit": row.sign_bit,
        "low": row.low,
        "high": row.high,
        "default": row.default,
        "unit": row.unit,
        "scale": row.scale,
        "choices": {str(value): meaning for value, meaning in row.choices.items()},
        "bits": {str(bit): meaning for bit, meaning in row.bits.items()},
        "effect": row.effect.name.lower(),
        "protected": row.protected,
        "source": row.source,
        "conflict": row.conflict,
        "note": row.note,
    }


def _cells(row: Register) -> list[object]:
    sign = f"bit {row.sign_bit}" if row.coding is Coding.SIGN_MAGNITUDE else ""
    unit = f"{row.scale:.6g} {row.unit}" if row.unit else ""
    effect = row.effect.name.lower() if row.writable else ""
    return [
        *(
            row.address,
            row.name,
            row.size,
            row.storage.value,
            row.access.value,
            sign,
            f"{row.low} to {row.high}",
        ),
        *(row.default, unit, effect, row.source, "in doubt" if row.conflict else ""),
    ]


def meanings(row: Register) -> Iterator[str]:
    """What single values and single bits of a row mean, and that it may not be copied between servos."""
    yield from (f"{value} {meaning}" for value, meaning in row.choices.items())
    yield from (f"bit {bit} {meaning}" for bit, meaning in row.bits.items())
    if row.protected and row.writable:
        yield "never copied from another servo"


def _model(major: int, minor: int, model: Model) -> dict[str, Any]:
    return {
        "number": model_number(major, minor, model.order),
        "major": major,
        "minor": minor,
        "name": model.name,
        "maps": list(model.maps),
        "byte_order": model.order,
        "resolution": model.resolution,
        "arc": model.arc,
        "note": model.note,
    }


def _model_cells(one: dict[str, Any]) -> list[object]:
    return [
        *(one["number"], f"{one['major']}.{one['minor']}", one["name"], " or ".join(one["maps"])),
        *(one["byte_order"], one["resolution"], f"{one['arc']:g}°", one["note"]),
    ]
