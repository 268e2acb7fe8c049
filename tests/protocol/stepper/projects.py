"""Any project that a file may hold, for the tests of this folder."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypothesis import strategies as st

from motorbus.families.stepper.parameters import (
    BASE_NAMES,
    PARAMETERS,
    STEP_NAMES,
    Project,
    Step,
    with_steps,
)


def numbers(name: str) -> st.SearchStrategy[int]:
    """Any value that a request may carry."""
    row = PARAMETERS[name]
    if name in ("start_input", "stop_input"):
        return st.sampled_from((0, 1, 2, 5))
    return st.integers(row.low, row.high)


@st.composite
def projects(draw: st.DrawFn) -> Project:
    """One to ten steps, a loop or none, and no numbers behind the last step."""
    count = draw(st.integers(1, 10))
    steps = tuple(Step(**{name: draw(numbers(name)) for name in STEP_NAMES}) for _ in range(count))
    values: dict[str, Any] = {name: draw(numbers(name)) for name in BASE_NAMES}
    first = draw(st.integers(0, count))
    last = draw(st.integers(first, count)) if first else 0
    loop = draw(st.integers(1, 254)) if first else 0
    values |= {"number": draw(st.integers(1, 4)), "loop_first": first, "loop_last": last, "loop_count": loop}
    return replace(with_steps(Project(), steps), **(values | {"total_steps": count}))
