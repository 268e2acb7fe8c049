"""Any behaviour, and projects that are over soon, so that machine and driver can be compared by chance."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from hypothesis import strategies as st

from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.table import Project, Step, with_steps


def _one(name: str) -> st.SearchStrategy[Any]:
    if name == "ramp_tick_ms":
        return st.sampled_from((0.1, 1.0, 10.0))
    (told,) = (one for one in fields(Behaviour) if one.name == name)
    if isinstance(told.default, bool):
        return st.booleans()
    return st.sampled_from(told.metadata["choices"])


def switches(without: tuple[str, ...] = ()) -> st.SearchStrategy[dict[str, Any]]:
    """Any setting of the switches of execution, as options; those in `without` stay as they are."""
    names = [one.name for one in fields(Behaviour) if one.name not in without]
    return st.fixed_dictionaries({name: _one(name) for name in names})


def steps(inputs: bool = True) -> st.SearchStrategy[Step]:
    """A step of less than a second or so, with speed and start frequency as a careful hand would choose them."""
    port = st.sampled_from((0, 0, 0, 1, 2)) if inputs else st.just(0)
    return st.builds(
        Step,
        distance=st.integers(0, 3000),
        direction=st.integers(0, 1),
        start_frequency=st.integers(1, 1500),
        acceleration=st.integers(1, 500),
        speed=st.integers(60, 600),
        output=st.integers(0, 8),
        delay=st.integers(0, 600),
        start_input=port,
        stop_input=port,
    )


@st.composite
def short_projects(draw: st.DrawFn, inputs: bool = True) -> Project:
    """A project of up to four steps, with loops; 1600 pulses a turn, and a unit that is no whole pulse at times."""
    made = tuple(draw(st.lists(steps(inputs), min_size=1, max_size=4)))
    total = len(made)
    first = draw(st.integers(0, total))
    base = Project(
        number=draw(st.integers(1, 4)),
        microsteps=8,
        step_angle=180,
        turn_distance=draw(st.sampled_from((1600, 1700, 5000))),
        loop_first=first,
        loop_last=draw(st.integers(first, total)) if first else 0,
        loop_count=draw(st.integers(0, 3)),
        project_loop=draw(st.integers(0, 3)),
        stop_mode=draw(st.integers(0, 1)),
    )
    return with_steps(base, made)
