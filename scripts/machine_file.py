"""Makes docs/reference/machine-file.md, and beside it the JSON Schema, from the types of the machine file.

So the page cannot say anything else than what is read. `--check` sees that both are current.
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

HEAD: Final = """# The machine file

A machine is described in one file, `motorbus.toml`: its buses, the axes that move on them, groups of axes and poses.
This page has every key. It is made by `python -m scripts.machine_file` from the types that the program reads the file
with; the same is there [as JSON Schema](machine-file.json), with which an editor completes and checks as one writes:
keep a copy beside your file, and begin that with the line `#:schema ./machine-file.json`, which editors follow whose
TOML support is Taplo's.

```toml
format = 1
name = "bench"

[bus.arm]
address = "feetech:/dev/ttyACM0,baud=1000000"

[bus.gimbal]
address = "kst:can://slcan/dev/ttyACM1,bitrate=500000"

[axis.shoulder]
device = "arm#1"
zero = "180 deg"
sign = -1
gear = 3.0
low = "-90 deg"
high = "90 deg"
max_velocity = "120 deg/s"
max_acceleration = "500 deg/s2"
max_step = "10 deg"
exit = "park"
park = "0 deg"
torque = 0.5

[axis.slide]
device = "gimbal#0x25"
travel = "5 mm"
low = "0 mm"
high = "120 mm"

[group.all]
axes = ["shoulder", "slide"]

[pose.ready]
shoulder = "10 deg"
slide = "30 mm"
```

- A number with a unit stands in quotes: `"90 deg"`, `"2 turn"`, `"30 mm"`, `"0.4 A"`. Angles, lengths, velocities and
  accelerations need their unit: a bare number is refused. A current without a unit is in A.
- The name of a bus, an axis, a group or a pose begins with a lower case letter and goes on with lower case letters,
  digits, `_` and `-`, 40 in all at most. No two buses, axes and groups share one.
- A key that is not on this page is an error, and so is whatever cannot be meant. There is one message, with the place
  in the file, what may stand there and what to do, and nothing has been opened.
"""

BARE: Final = {"current": "in A", "load": "a fraction of 1"}

CONVERSION: Final = """## Positions and angles

An axis is at 0 where its device is at `zero`. From there the device turns by `gear` for each turn of the axis, against
it where `sign` is -1. A linear axis, which is one with `travel`, goes that far in one turn of the axis:

```text
angle of the device = zero + sign × gear × position                    an axis that turns (rad)
angle of the device = zero + sign × gear × 2π × position / travel      a linear axis (m)
```

Velocities and accelerations are converted likewise, without `zero`. `low`, `high`, `park`, `max_step` and poses are
positions of the axis, not angles of the device.

```python
from math import pi

from motorbus.motion.machine import Machine

machine = Machine.parse(\"\"\"
format = 1
[bus.arm]
address = "feetech:sim,ids=1"
[axis.slide]
device = "arm#1"
travel = "5 mm"
gear = 2.0
\"\"\")
slide = machine.axes["slide"]
assert abs(slide.to_device(0.005) - 4 * pi) < 1e-9  # 5 mm are two turns of the device
assert abs(slide.from_device(4 * pi) - 0.005) < 1e-9
```
"""

EDITS: Final = """## Edits by a program

`edited` changes values, adds and takes out keys and tables; `renamed` gives a bus, an axis, a group or a pose another
name wherever it stands. Comments, order and blank lines stay as the person wrote them. The new text is compared with
what it should say, and read as a machine, before it is returned.

```python
from motorbus.motion.machine import edited, renamed

text = \"\"\"format = 1
[bus.arm]
address = "feetech:sim,ids=1"
[axis.shoulder]
device = "arm#1"
zero = "180 deg"     # measured by hand
\"\"\"
text = edited(text, {"axis.shoulder.zero": "181.5 deg", "pose.rest": {"shoulder": "0 deg"}})
text = renamed(text, "axis.shoulder", "upper")
assert 'zero = "181.5 deg"     # measured by hand' in text
assert text.endswith('[pose.rest]\\nupper = "0 deg"\\n')
```
"""

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
    """The whole page."""
    return (
        "\n".join([HEAD, *_file(), *_tables(), *_exits(), *_estops(), *_units(), CONVERSION, EDITS]).rstrip()
        + "\n"
    )


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
