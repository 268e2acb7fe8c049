"""What happens at the inputs, as a text: one change on each line, `SECONDS INPUT on|off`.

    # the operator puts a tray in, and the part is felt 0.8 s later
    2.5   1  on
    2.7   1  off
    3.3   2  on

Seconds count from the first moment of the simulation, which is when the supply of the controller comes.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from motorbus.errors import RequestError
from motorbus.families.stepper.table import INPUTS

MOST: Final = 100_000
_LINE: Final = re.compile(r"(\d{1,9}(?:\.\d{0,9})?)[\s,]+(\d{1,3})[\s,]+(on|off)", re.ASCII)


class Change(NamedTuple):
    """At this moment (s) this input becomes active or inactive."""

    at: float
    port: int
    active: bool


def parse(text: str) -> list[Change]:
    """Every change, in order of time. Raises RequestError, naming the line, for one that is none."""
    found: list[Change] = []
    for number, line in enumerate(text.splitlines(), start=1):
        said = line.partition("#")[0].strip()
        if not said:
            continue
        match = _LINE.fullmatch(said)
        if match is None or not 1 <= int(match[2]) <= INPUTS:
            raise RequestError(
                f"inputs, line {number}: {line.strip()!r} is no change",
                expected=f"SECONDS INPUT on|off, input 1 to {INPUTS}, such as 2.5 1 on",
                advice="correct the file; nothing was done",
            )
        found.append(Change(float(match[1]), int(match[2]), match[3] == "on"))
        if len(found) > MOST:
            raise RequestError(f"inputs: more than {MOST} changes")
    return sorted(found, key=lambda change: change.at)
