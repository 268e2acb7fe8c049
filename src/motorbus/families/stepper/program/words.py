"""What a file calls each parameter, and what that may be in the words of the file.

The controller has names of its own, which dumps, registers and frames are told by. Whoever has written `wait_for` is
not helped by an error about `start_input`, nor by hundredths of a degree where the file has degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.register import shown
from motorbus.families.stepper.program.quantities import clock, refuse
from motorbus.families.stepper.table import ENDLESS, PARAMETERS, allowed, is_allowed

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
HELD: Final[Mapping[str, range]] = {
    "loop_count": range(ENDLESS + 1),
    **{name: range(PARAMETERS[name].high + 1) for name in ("microsteps", "step_angle", "turn_distance")},
}
"""What a controller may hold and no command should say: 0 where nothing was set since it was cleared, a count of 255.

The lint tells what becomes of it. A file says it with `expert`, else it is a slip.
"""


def within(name: str, raw: int, step: int = 0, *, expert: bool = False) -> None:
    """Raises RequestError, with the file's word for it, for a raw number that a parameter may not be.

    An `expert` may also use inputs 3 and 4, and say what a controller may hold (`HELD`).
    """
    if not (is_allowed(name, raw, expert=expert) or (expert and raw in HELD.get(name, ()))):
        where = f"step {step}, " if step else ""
        raise refuse(f"{where}{WORDS.get(name, name)}: {shown(raw)} is not possible", range_of(name, expert))


def range_of(name: str, expert: bool = False) -> str:
    """What a parameter may be, as a file says it."""
    if expert and name in HELD:
        return f"0 to {HELD[name][-1]}"
    row = PARAMETERS[name]
    if name == "delay":
        return f"{clock(row.low)} to {clock(row.high)} (raw {row.low} to {row.high})"
    if name == "step_angle":
        return f"{row.low / 100:g} deg to {row.high / 100:g} deg (raw {row.low} to {row.high})"
    return allowed(name, expert=expert)
