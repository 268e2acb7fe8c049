"""Makes docs/reference/feetech-registers.md, and beside it the same as JSON, from the rows of the register maps.

So the page cannot say anything else than what the program does. `--check` sees that both are current.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from motorbus.core.register import Register, RegisterMap
from motorbus.families.feetech.models import FIRMWARE, MODELS, model_number
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.codes import ALARM_BITS, BAUD_CODES, BAUD_CODES_OF, PHASE_BITS
from scripts.pages import assumptions, kept, listed

ROOT: Final = Path(__file__).resolve().parent.parent
PAGE: Final = ROOT / "docs" / "reference" / "feetech-registers.md"
DATABASE: Final = PAGE.with_suffix(".json")
FAMILY: Final = ROOT / "src" / "motorbus" / "families" / "feetech"

HEAD: Final = """# FEETECH registers

FEETECH servos have six register maps, and the model does not tell which: firmware and byte order do. This page has
every row of each map with its source. Where sources disagree, or none confirms a row, "In doubt" names who says what,
and what was chosen. `python -m scripts.feetech_registers` generates the page from the rows that the program uses, and
the same rows [as JSON](feetech-registers.json).

Servos of all six maps are found, identified, read, written, moved and simulated. One address means another register in
another map: 48 is the torque limit in three maps and the lock in three. A servo with other firmware is read by what all
maps share, and never written, but for torque off.

A word has its low byte first (little-endian), on SCS its high byte. A negative number is the magnitude with the sign
bit set; never two's complement. The range bounds the raw number; times the unit it is a value. The effect is the worst
that writing can do. What is written to EEPROM lasts only when the lock is open.
"""


def page() -> str:
    """The whole page."""
    maps = [line for table in TABLES.values() for line in _map(table)]
    parts = (_choice(), maps, _models(), _baud_codes(), _alarms(), _phase(), _assumptions())
    return "\n".join([HEAD, *(line for part in parts for line in part)])


def _data(table: RegisterMap) -> dict[str, Any]:
    """A map as plain data: everything that its rows say."""
    (order,) = {row.order for row in table.values()}
    rows = [_row_data(row) for row in table.values()]
    return {"name": table.name, "title": table.title, "byte_order": order, "registers": rows}


def _row_data(row: Register) -> dict[str, Any]:
    plain = ("name", "address", "size", "sign_bit", "low", "high", "default", "unit", "scale")
    return {
        **{name: getattr(row, name) for name in plain[:3]},
        **{name: getattr(row, name).value for name in ("storage", "access", "coding")},
        **{name: getattr(row, name) for name in plain[3:]},
        "choices": {str(value): meaning for value, meaning in row.choices.items()},
        "bits": {str(bit): meaning for bit, meaning in row.bits.items()},
        "effect": row.effect.name.lower(),
        **{name: getattr(row, name) for name in ("protected", "source", "conflict", "note")},
    }


def _meanings(row: Register) -> Iterator[str]:
    """The meaning of single values and bits of a row, and whether it must not be copied between servos."""
    yield from (f"{value} {meaning}" for value, meaning in row.choices.items())
    yield from (f"bit {bit} {meaning}" for bit, meaning in row.bits.items())
    if row.protected and row.writable:
        yield "never copied from another servo"


def text_of_database() -> str:
    """All maps as JSON, one register on a line."""
    maps = []
    for one in map(_data, TABLES.values()):
        rows = ",\n".join(f"   {json.dumps(row, ensure_ascii=False)}" for row in one.pop("registers"))
        maps.append(f'{json.dumps(one, ensure_ascii=False)[:-1]}, "registers": [\n{rows}\n  ]}}')
    return '{"schema": "motorbus.feetech.registers/1", "maps": [\n  ' + ",\n  ".join(maps) + "\n]}\n"


def _choice() -> Iterator[str]:
    yield "## Which map a servo has\n"
    yield "By registers 0 to 4: firmware, byte order, model. The model number decides the byte order, for an unknown"
    yield "one register 2 does. Other firmware has no map here: it is read by what all maps share.\n"
    rows: list[list[object]] = []
    for major, minors, order, table in FIRMWARE:
        versions = f"{major}.{minors.start} to {major}.{minors.stop - 1}"
        rows.append([versions, order, f"[{table}](#{table})"])
    yield from listed(("firmware", "byte order", "map"), rows)


def _map(table: RegisterMap) -> Iterator[str]:
    yield f"## {table.name}\n"
    yield f"{table.title[0].upper()}{table.title[1:]}. {len(table)} registers.\n"
    yield from listed(("address", "register", "meaning and source"), map(_row, table.values()))


def _row(row: Register) -> list[object]:
    facts = [
        f"{row.size} byte{'s' if row.size > 1 else ''}",
        row.storage.value,
        row.access.value,
        f"{row.low} to {row.high}",
    ]
    if row.sign_bit is not None:
        facts.append(f"sign in bit {row.sign_bit}")
    if row.default is not None:
        facts.append(f"shipped {row.default}")
    if row.unit:
        facts.append(f"1 = {row.scale:.6g} {row.unit}")
    if row.writable:
        facts.append(f"effect {row.effect.name.lower()}")
    parts = [
        ", ".join(facts),
        "; ".join(_meanings(row)),
        row.note,
        row.source and f"Source: {row.source}",
        row.conflict and f"In doubt: {row.conflict}",
    ]
    return [row.address, f"`{row.name}`", "<br>".join(part for part in parts if part)]


def _models() -> Iterator[str]:
    yield "## Models\n"
    yield "A number is a name and a byte order. Variants with another supply voltage or gear ratio share a number, so"
    yield "neither can be read; the map is what such servos usually have, and only the firmware tells.\n"
    rows: list[list[object]] = [
        [
            *(
                model_number(*number, model.order),
                f"{number[0]}.{number[1]}",
                model.name,
                " or ".join(model.maps),
            ),
            *(model.order, f"{model.resolution} over {model.arc:g}°", model.arc_doubt, model.note),
        ]
        for number, model in MODELS.items()
    ]
    yield from listed(
        ("number", "major.minor", "model", "map", "byte order", "counts", "in doubt", "note"), rows
    )


def _baud_codes() -> Iterator[str]:
    yield "## Baud codes\n"
    yield "Register 6. Some libraries give other rates for 5 to 7, which loses the servo.\n"
    rows: list[list[object]] = [
        [code, rate, ", ".join(name for name, codes in BAUD_CODES_OF.items() if code in codes) or "none"]
        for code, rate in BAUD_CODES.items()
    ]
    yield from listed(("code", "bit/s", "maps that take it"), rows)


def _alarms() -> Iterator[str]:
    yield "## Alarm bits\n"
    yield "Of the error byte in every answer, of register 65, and of the masks 19 and 20.\n"
    yield from _bits(ALARM_BITS)


def _phase() -> Iterator[str]:
    yield "## Phase byte\n"
    yield "Register 18; the meaning of each bit that is set. It belongs to one servo and is never copied.\n"
    yield from _bits(PHASE_BITS)


def _bits(of_maps: Mapping[str, Mapping[int, str]]) -> Iterator[str]:
    rows: list[list[object]] = [[bit, *(bits.get(bit, "") for bits in of_maps.values())] for bit in range(8)]
    yield from listed(("bit", *of_maps), rows)


def _assumptions() -> Iterator[str]:
    yield "## Assumptions\n"
    yield "What no source states, by file of `motorbus.families.feetech`; each is a constant in the code.\n"
    yield from listed(("where", "assumed"), assumptions(FAMILY))


def main() -> int:
    """Write page and database, or with --check see that those there are those that would be written."""
    return kept({PAGE: page(), DATABASE: text_of_database()})


if __name__ == "__main__":
    sys.exit(main())
