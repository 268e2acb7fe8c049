"""Makes the tables of docs/reference/machine-file.md, and the JSON schema beside it, from the types of that file.

`--check` only compares.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, get_args, get_type_hints

from motorbus.core import units
from motorbus.motion import machine
from motorbus.motion.machine import AxisConfig, Quantity
from motorbus.motion.machine_edit import schema
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
    definitions = schema()["$defs"]
    for title, name in (("bus", "BusConfig"), ("axis", "AxisConfig")):
        yield f"## `[{title}.NAME]`\n"
        yield from listed(columns, _rows(definitions[name]))
    yield "## Units\n"
    kinds = [kind for quantity in QUANTITIES for kind in quantity.kinds]
    yield from listed(("quantity", "units"), [[kind, ", ".join(units.SCALES[kind])] for kind in kinds])


def _rows(definition: Mapping[str, Any]) -> Iterator[list[str]]:
    hints = get_type_hints(AxisConfig)
    for key, value in definition["properties"].items():
        default = "needed" if key in definition["required"] else json.dumps(value.get("default"))
        yield [
            f"`{key}`",
            value.get("description", ""),
            _type(value, hints.get(key)),
            f"`{default}`" if default not in ("needed", "null") else default.removeprefix("null"),
        ]


def _type(value: Mapping[str, Any], hint: Any) -> str:
    kinds = [one for one in (hint, *get_args(hint)) if isinstance(one, type) and issubclass(one, Quantity)]
    if kinds:
        return " or ".join(kinds[0].kinds)
    if "anyOf" in value:
        value = next(one for one in value["anyOf"] if one.get("type") != "null")
    if "enum" in value:
        return " or ".join(f"`{json.dumps(word)}`" for word in value["enum"] if word is not None)
    return {"number": "number", "boolean": "`true` or `false`", "string": "text"}[value["type"]]


def main() -> int:
    """Write page and schema, or with --check compare them."""
    text = json.dumps(schema(), ensure_ascii=False, indent=1) + "\n"
    return kept({PAGE: page(), SCHEMA: text})


if __name__ == "__main__":
    sys.exit(main())
