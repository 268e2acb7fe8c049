"""Generates docs/reference/stepper.md from the tables of the stepper family.

`--check` fails if the page is not current.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from motorbus.core.register import Register
from motorbus.families.stepper.parameters import BASE, REQUEST_ONLY, STEP, allowed
from motorbus.families.stepper.program.lint import RULES
from motorbus.families.stepper.protocol import COMMANDS, Command, encode
from motorbus.families.stepper.simulator import OPTIONS
from scripts.pages import assumptions, kept, listed

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "reference" / "stepper.md"
FAMILY: Final = PAGE.parents[2] / "src" / "motorbus" / "families" / "stepper"
TESTS: Final = "tests/protocol/stepper/test_protocol.py"

HEAD: Final = """# Stepper controller reference

Commands, parameters, checks and assumptions of the programmable stepper controller. Its one source is the stepper
controller serial protocol manual; no such controller was available.

A request has 11 bytes: `FF AA`, 8 bytes, and the low byte of the sum of the ten bytes before. A reply has 6 bytes
without a checksum, 226 for "read project". `EE DD` is the notice that the project that was started has ended. The
line has 9600 bit/s, 8 data bits, no parity, 1 stop bit.

`python -m scripts.stepper_reference` generates this page from the tables that the program uses.
"""


def page() -> str:
    """The whole page."""
    parts = (_commands(), _parameters(), _rules(), _assumptions())
    return "\n".join([HEAD, *(line for part in parts for line in part)])


def _commands() -> Iterator[str]:
    yield "## Commands of the manual\n"
    yield "Each command is a method of `motorbus.stepper.Controller`. The bytes are those of the request with 1 for"
    yield f"each number. The test of each row is `{TESTS}::test_a_request_is_encoded_and_decoded`.\n"
    yield from listed(("item", "meaning", "bytes"), map(_command, COMMANDS.values()))


def _command(row: Command) -> tuple[str, str, str]:
    note = f"<br>{row.note[0].upper()}{row.note[1:]}." if row.note else ""
    numbers = ", ".join(f"`{name}`" for name in row.fields) or "no number"
    request = encode(row.name, **dict.fromkeys(row.fields, 1)).hex(" ").upper()
    return f"{row.number}. `{row.name}`", f"{row.title}: {numbers}.{note}", f"`{request}`"


def _parameters() -> Iterator[str]:
    yield "## Parameters\n"
    yield "A project is 220 bytes: 11 rows of 20. Row 0 is the project, rows 1 to 10 are its steps. In `motorbus read`"
    yield "the parameters of a step have its number: `step_3_delay`. A row gives its offset, and its raw values.\n"
    for title, rows in (("the project", BASE), ("a step", STEP), ("requests only", REQUEST_ONLY)):
        yield f"Of {title}:\n"
        yield from listed(("name", "bytes", "values", "meaning"), map(_parameter, rows))


def _parameter(row: Register) -> tuple[str, str, str, str]:
    place = f"{row.address}" if row.size == 1 else f"{row.address} to {row.address + row.size - 1}"
    note = f"{row.note[0].upper()}{row.note[1:]}. " if row.note else ""
    return f"`{row.name}`", place, allowed(row.name), f"{note}Source: {row.source}."


def _rules() -> Iterator[str]:
    yield "## Checks of a program\n"
    rows = [(rule, level, f"{reason[0].upper()}{reason[1:]}.") for rule, (level, reason) in RULES.items()]
    yield from listed(("rule", "level", "reason"), rows)


def _assumptions() -> Iterator[str]:
    yield "## Assumptions\n"
    yield "Options of the simulator, as in `stepper:sim,select=relabel`:\n"
    rows = []
    for one in OPTIONS:
        values = f" Values: {', '.join(map(str, one.choices))}." if one.choices else ""
        rows.append((f"`{one.name}`", one.default, f"{one.help}.{values} Source: {one.source}."))
    yield from listed(("option", "default", "meaning"), rows)
    yield "What the manual does not say, and what motorbus assumes:\n"
    yield from listed(("where", "assumed"), assumptions(FAMILY))


def main() -> int:
    """Write the page; with --check return 1 if it is not current."""
    return kept({PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
