"""Projects as the commands that write them: there is no block write.

A project of n steps takes 8 + 7n commands before it is saved. The first selects it and sets its number of steps, so no
edit is possible without a write of that number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from motorbus.families.stepper.parameters import BASE_NAMES, STEPS, Project
from motorbus.families.stepper.protocol import COMMANDS, Command

_OF_PROJECT: Final = tuple(one for one in COMMANDS.values() if one.is_edit and "step" not in one.fields)
_OF_STEP: Final = tuple(one for one in COMMANDS.values() if "step" in one.fields)


class Edit(NamedTuple):
    """One command that sets parameters, and its numbers."""

    command: str
    values: Mapping[str, int]


def edits(project: Project, *, rows: int | None = None) -> list[Edit]:
    """The commands that write this project, in order; `rows` of its steps, as many as it carries out if None."""
    count = min(project.total_steps, STEPS) if rows is None else rows
    found = [_edit(project, command) for command in _OF_PROJECT]
    for step in range(1, count + 1):
        found += [_edit(project, command, step) for command in _OF_STEP]
    return found


def edits_between(before: Project, after: Project) -> list[Edit]:
    """The commands that turn one project into another, the selection first; none if nothing differs."""
    pairs = zip(edits(before, rows=STEPS), edits(after, rows=STEPS), strict=True)
    found = [new for old, new in pairs if old != new]
    select = _edit(after, COMMANDS["select_project"])
    if found and found[0] != select:
        found.insert(0, select)
    return found


def edited(project: Project, command: str, values: Mapping[str, int]) -> Project:
    """The project after a command that sets parameters; a step that does not exist changes nothing."""
    changes: dict[str, Any] = dict(values)
    if "step" in changes:
        step = changes.pop("step")
        return project.with_step(step, **changes) if 1 <= step <= STEPS else project
    if command == "select_project":
        changes["number"] = changes.pop("project")
    return replace(project, **changes)


def _edit(project: Project, command: Command, step: int = 0) -> Edit:
    known = {"project": project.number, "step": step}
    values = {}
    for name in command.fields:
        source = project if name in BASE_NAMES else project.step(step or 1)
        values[name] = known[name] if name in known else getattr(source, name)
    return Edit(command.name, values)
