"""What a file calls each parameter, and what that may be in the words of the file.

The controller has names of its own, which dumps, registers and frames are told by. Whoever has written `wait_for` is
not helped by an error about `start_input`, nor by hundredths of a degree where the file has degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.entry import shown
from motorbus.families.stepper.program.quantities import clock, refuse
from motorbus.families.stepper.table import PARAMETERS, allowed, is_allowed

WORDS: Final[Mapping[str, str]] = {
    "number": "project",
    "project_loop": "repeat",
    "loop_first": "[loop], first",
    "loop_last": "[loop], last",
    "loop_count": "[loop], count",
    "stop_mode": "stop",
    "power_on_home": "home_at_power_on",
    "distance": "move",
    "direction": "the sign of move",
    "start_frequency": "start",
    "start_input": "wait_for",
    "stop_input": "stop_on",
}
"""What a file calls a parameter that the controller calls otherwise."""


def within(name: str, raw: int, step: int = 0, *, expert: bool = False) -> None:
    """Raises RequestError, with the file's word for it, for a raw number that a parameter may not be."""
    if not is_allowed(name, raw, expert=expert):
        where = f"step {step}, " if step else ""
        raise refuse(f"{where}{WORDS.get(name, name)}: {shown(raw)} is not possible", range_of(name, expert))


def range_of(name: str, expert: bool = False) -> str:
    """What a parameter may be, as a file says it."""
    row = PARAMETERS[name]
    if name == "delay":
        return f"{clock(row.low)} to {clock(row.high)} (raw {row.low} to {row.high})"
    if name == "step_angle":
        return f"{row.low / 100:g} deg to {row.high / 100:g} deg (raw {row.low} to {row.high})"
    return allowed(name, expert=expert)
