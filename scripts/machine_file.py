"""Makes the tables of docs/reference/machine-file.md, and the JSON schema beside it, from the types of that file.

`--check` only compares.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal, get_args, get_origin, get_type_hints

from msgspec import NODEFAULT, Struct, structs

from motorbus.core import units
from motorbus.motion import machine
from motorbus.motion.machine import AxisConfig, BusConfig, Quantity
from motorbus.motion.machine_edit import description_of, schema, split_hint
from scripts.pages import kept, listed

ROOT: Final = Path(__file__).resolve().parent.parent
PAGE: Final = ROOT / "docs" / "reference" / "machine-file.md"
SCHEMA: Final = PAGE.with_suffix(".json")
FIRST: Final = "## `[bus.NAME]`\n"
BEHIND: Final = "## Positions and angles\n"
QUANTITIES: Final = (machine.Position, machine.Velocity, machine.Acceleration)


def page() -> str:
    """The page with new tables; the text before and after them is kept."""
    head, _, rest = PAGE.read_text("utf-8").partition(FIRST)
    _, _, tail = rest.partition(BEHIND)
    return head + "\n".join(_tables()) + "\n" + BEHIND + tail


def _tables() -> Iterator[str]:
    columns = ("key", "meaning", "is", "default")
    yield FIRST
    yield from listed(columns, _rows(BusConfig))
    yield "## `[axis.NAME]`\n"
    yield from listed(columns, _rows(AxisConfig))
    yield "## Units\n"
    kinds = [kind for quantity in QUANTITIES for kind in quantity.kinds]
    yield from listed(("quantity", "units"), [[kind, ", ".join(units.SCALES[kind])] for kind in kinds])


def _rows(kind: type[Struct]) -> Iterator[list[str]]:
    hints = get_type_hints(kind, include_extras=True)
    for field in structs.fields(kind):
        hint = hints[field.name]
        default = "needed" if field.default is NODEFAULT else _default(field.default)
        yield [f"`{field.name}`", description_of(hint), _type(hint), default]


def _default(value: object) -> str:
    if value is None:
        return ""
    return f"`{json.dumps('0 deg' if isinstance(value, Quantity) else value)}`"


def _type(hint: Any) -> str:
    kind, _ = split_hint(hint)
    if get_origin(kind) is Literal:
        return " or ".join(f"`{json.dumps(word)}`" for word in get_args(kind))
    if issubclass(kind, Quantity):
        return " or ".join([*kind.kinds, *(["raw counts"] if kind.counts else [])])
    return {float: "number", bool: "`true` or `false`", str: "text"}[kind]


def main() -> int:
    """Write page and schema, or with --check compare them."""
    text = json.dumps(schema(), ensure_ascii=False, indent=1) + "\n"
    return kept({PAGE: page(), SCHEMA: text})


if __name__ == "__main__":
    sys.exit(main())
