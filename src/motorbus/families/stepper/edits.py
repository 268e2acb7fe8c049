"""Projects as the commands that write them: there is no block write.

The first command selects the project and sets its number of steps, so no edit is possible without a write of that
number. A whole project takes 78 commands before it is saved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from motorbus.families.stepper.parameters import BASE_NAMES, STEPS, Project
from motorbus.families.stepper.protocol import COMMANDS, Command

_EDITS: Final = [command for command in COMMANDS.values() if command.is_edit]


class Edit(NamedTuple):
    """One command that sets parameters, and its numbers."""

    command: str
    values: Mapping[str, int]


def edits(project: Project) -> list[Edit]:
    """The commands that write this project with all ten steps, in order."""
    found = [_edit(project, command) for command in _EDITS if "step" not in command.fields]
    for step in range(1, STEPS + 1):
        found += [_edit(project, command, step) for command in _EDITS if "step" in command.fields]
    return found


def edits_between(before: Project, after: Project) -> list[Edit]:
    """The commands that turn one project into another, the selection first; none if nothing differs."""
    select, *_ = new = edits(after)
    found = [one for old, one in zip(edits(before), new, strict=True) if old != one]
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
