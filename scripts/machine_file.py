"""Makes the tables of docs/reference/machine-file.md, and the JSON Schema beside it, from the types of that file.

`--check` sees that both are current.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from motorbus.core import units
from motorbus.motion.machine import keys, schema
from motorbus.motion.machine.keys import Key, word
from motorbus.motion.machine.model import ESTOPS, EXITS
from scripts.pages import kept, listed

ROOT: Final = Path(__file__).resolve().parent.parent
PAGE: Final = ROOT / "docs" / "reference" / "machine-file.md"
SCHEMA: Final = PAGE.with_suffix(".json")

FIRST: Final = "## The file itself\n"
BEHIND: Final = "## Positions and angles\n"
BARE: Final = {"current": "in A", "load": "a fraction of 1"}

COLUMNS: Final = ("key", "meaning", "is", "range", "default", "example")
TABLES: Final[Mapping[str, tuple[str, Mapping[str, Key]]]] = {
    "[bus.NAME]": ("A bus.", keys.BUS),
    "[axis.NAME]": (
        "An axis. Where two values stand, the first is for an axis that turns, the second for a linear one.",
        keys.AXIS,
    ),
    "[group.NAME]": ("Axes that are moved together under one name.", keys.GROUP),
}
AGREE: Final = """\
What keys must agree on: `low` and `high` come together, and `low` is below `high`; `park` and poses lie between them;
`exit = "park"` needs `park`; of `torque` and `current` there is one at most; `unit` is one for the kind of axis; a
device moves one axis.
"""


def page() -> str:
    """The page with its tables made anew; the text before and after them is kept."""
    head, _, rest = PAGE.read_text("utf-8").partition(FIRST)
    _, _, tail = rest.partition(BEHIND)
    return head + "\n".join([*_file(), *_tables(), *_exits(), *_estops(), *_units()]) + "\n" + BEHIND + tail


def text_of_schema() -> str:
    """The JSON Schema as text."""
    return json.dumps(schema(), ensure_ascii=False, indent=1) + "\n"


def _file() -> Iterator[str]:
    yield "## The file itself\n"
    rows = [["`format`", "the kind of file this is", "1, needed"]]
    rows += [
        [f"`{key.name}`", key.says, "text" if key.kind is str else "tables"] for key in keys.FILE.values()
    ]
    yield from listed(("key", "meaning", "is"), rows)


def _tables() -> Iterator[str]:
    for title, (says, rows) in TABLES.items():
        yield f"## `{title}`\n\n{says}\n"
        yield from listed(COLUMNS, map(_row, rows.values()))
        if rows is keys.AXIS:
            yield AGREE
    yield '## `[pose.NAME]`\n\nA position for each axis that it names: `shoulder = "10 deg"`.\n'


def _row(key: Key) -> list[str]:
    return [
        f"`{key.name}`",
        key.says,
        _both(lambda linear: _kind(key, linear)),
        _both(key.range),
        _both(lambda linear: _default(key, linear)),
        _both(lambda linear: f"`{key.example[linear]}`"),
    ]


def _kind(key: Key, linear: bool) -> str:
    if key.measure:
        return key.measure.of(linear)
    if key.choices(linear):
        return " or ".join(f"`{word(choice)}`" for choice in key.choices(linear))
    return {str: "text", float: "number"}.get(key.kind, "list of names")


def _default(key: Key, linear: bool) -> str:
    if key.needed:
        return "needed"
    value = key.usual[linear] or key.default
    return "none" if value is None else f"`{word(value)}`"


def _exits() -> Iterator[str]:
    yield "## `exit`\n\nWhat an axis does when the program ends: by its end, an error, a signal, or a lost lease.\n"
    yield from listed(("exit", "means"), [[f"`{name}`", means] for name, means in EXITS.items()])


def _estops() -> Iterator[str]:
    yield (
        "## `estop`\n\nWhat an emergency stop does to an axis. What a device cannot do is refused before a port is "
        "opened: `torque_off` and `hold` are for FEETECH servos, which let go if nothing is said; KST servos always "
        "hold; a stepper controller has one kind of stop, and no such key. See [Stop](../how-to/stop.md).\n"
    )
    yield from listed(("estop", "means"), [[f"`{name}`", means] for name, means in ESTOPS.items()])


def _units() -> Iterator[str]:
    yield "## Units\n\nThe units of a number, and what a number without a unit is.\n"
    measures = [key.measure for key in keys.AXIS.values() if key.measure]
    quantities = dict.fromkeys(quantity for measure in measures for quantity in measure)
    rows = [[one, BARE.get(one, "refused"), ", ".join(units.SCALES[one])] for one in quantities]
    yield from listed(("quantity", "without a unit", "units"), rows)


def _both(of: Any) -> str:
    """What holds on both kinds of axis, or one behind the other."""
    turning, linear = of(False), of(True)
    return str(turning) if turning == linear else f"{turning}; {linear}"


def main() -> int:
    """Write page and schema, or with --check see that those there are those that would be written."""
    return kept({PAGE: page(), SCHEMA: text_of_schema()})


if __name__ == "__main__":
    sys.exit(main())
