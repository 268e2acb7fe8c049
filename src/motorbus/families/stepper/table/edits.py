"""A project as the commands that write it, and what each of them changes: there is no block write.

A whole project of n steps takes 8 + 7n commands before it is saved. The first selects it, and sets how many steps it
has: that is one command, so nothing can be edited without writing the number of steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from motorbus.families.stepper import wire
from motorbus.families.stepper.table.project import STEPS, Project
from motorbus.families.stepper.table.rows import BASE_NAMES, TABLE

_OF_PROJECT: Final = (
    "select_project",
    "set_microstep_and_angle",
    "set_turn_distance",
    "set_segment_loop",
    "set_project_loop",
    "set_stop_mode",
    "set_mode4",
    "set_power_on_home",
)
_OF_STEP: Final = tuple(name for name, command in wire.COMMANDS.items() if command.echo == "step")


class Edit(NamedTuple):
    """One command that sets parameters, and the numbers it carries."""

    command: str
    values: Mapping[str, int]

    def frame(self, motor: int = wire.MOTOR) -> bytes:
        """Its request. Raises RequestError for a number that does not fit."""
        return wire.encode(self.command, motor=motor, **self.values)


def edits(project: Project, *, rows: int | None = None) -> list[Edit]:
    """The commands that write this project, in order; `rows` of its steps, as many as it carries out when None."""
    found = [Edit(name, _values(project, name)) for name in _OF_PROJECT]
    count = min(project.total_steps, STEPS) if rows is None else rows
    for step in range(1, count + 1):
        found += [Edit(name, _values(project, name, step)) for name in _OF_STEP]
    return found


def edits_between(before: Project, after: Project, *, rows: int | None = None) -> list[Edit]:
    """The commands that make one project of another, none when nothing differs; the first one selects it.

    Only for who knows what the controller holds. So many `rows` are compared; when None, those that are carried out by
    either of them.
    """
    count = min(max(before.total_steps, after.total_steps), STEPS) if rows is None else rows
    pairs = zip(edits(before, rows=count), edits(after, rows=count), strict=True)
    found = [new for old, new in pairs if old != new]
    if not found:
        return []
    first = edits(after)[0]
    return found if found[0] == first else [first, *found]


def edited(project: Project, command: str, values: Mapping[str, int]) -> Project:
    """The project after a command that sets parameters; a step that has no row changes nothing.

    Selecting a project sets its number and its number of steps; that it also loads what is stored is for others to say.
    """
    changes: dict[str, Any] = {
        name: value for name, value in values.items() if name not in ("step", "project")
    }
    if command == "select_project":
        return replace(project, number=values["project"], **changes)
    if "step" in values:
        return project.with_step(values["step"], **changes) if 1 <= values["step"] <= STEPS else project
    return replace(project, **changes)


def amended(project: Project, raws: Mapping[str, int]) -> Project:
    """The project with these numbers, by the names of the table, as `turn_distance` and `step_3_delay`.

    Raises KeyError for a name that is none.
    """
    for name, raw in raws.items():
        if name not in TABLE:
            raise KeyError(name)
        if name in BASE_NAMES:
            own: dict[str, Any] = {name: raw}
            project = replace(project, **own)
        else:
            _, step, field = name.split("_", 2)
            project = project.with_step(int(step), **{field: raw})
    return project


def _values(project: Project, command: str, step: int = 0) -> dict[str, int]:
    values = {}
    for place in wire.COMMANDS[command].places:
        if place.name == "project":
            values["project"] = project.number
        elif place.name == "step":
            values["step"] = step
        else:
            source = project if place.name in BASE_NAMES else project.step(step)
            values[place.name] = getattr(source, place.name)
    return values
