"""Any project that a file can say, and pieces of files for the tests of programs."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from motorbus.families.stepper import table
from motorbus.families.stepper.table import PARAMETERS, Project, Step, with_steps

MOTOR = """
[motor]
microsteps = 8
step_angle = "1.8 deg"
turn_distance = 5000
lead = "5 mm"
"""
STEP = """
[[step]]
move = "10 mm"
speed = "60 rpm"
start = "200 Hz"
acceleration = "100 Hz"
"""


def file(*parts: str, top: str = "", motor: str = MOTOR, steps: int = 1) -> str:
    """A file with these parts behind a motor and some steps."""
    return "format = 1\n" + top + "\n" + motor + STEP * steps + "\n".join(parts)


def _numbers(name: str) -> st.SearchStrategy[int]:
    row = PARAMETERS[name]
    if name in ("start_input", "stop_input"):
        return st.sampled_from((0, 1, 2, 5))
    return st.integers(row.low, row.high)


@st.composite
def projects(draw: st.DrawFn) -> Project:
    """Any project that may be sent, with rows filled behind the last step too."""
    steps = tuple(
        Step(**{name: draw(_numbers(name)) for name in table.STEP_NAMES})
        for _ in range(draw(st.integers(1, 10)))
    )
    total = draw(st.integers(1, len(steps)))
    first = draw(st.integers(0, total))
    last = draw(st.integers(first, total)) if first else 0
    values: dict[str, Any] = {
        name: draw(_numbers(name))
        for name in table.BASE_NAMES
        if name not in ("number", "total_steps", "loop_first", "loop_last")
    }
    base = Project(number=draw(st.integers(1, 4)), loop_first=first, loop_last=last, **values)
    made = with_steps(base, steps)
    return Project(**{**{n: getattr(made, n) for n in Project.__dataclass_fields__}, "total_steps": total})
