"""The order of the steps of a project, and how often it runs.

After the last step of the step loop follows its first, as often as the loop counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from motorbus.families.stepper.parameters import Project


class Place(NamedTuple):
    """A place in one pass of a project: the step, 1 to 10, and the pass of the step loop, from 1."""

    step: int
    lap: int = 1


def passes(project: Project) -> int | None:
    """How often the project runs; None: until it is stopped."""
    if project.is_endless:
        return None
    return max(1, project.project_loop)  # counts are totals, 0 is 1 # assumption


def following(project: Project, place: Place) -> Place | None:
    """The next place in the same pass of the project; None at its end."""
    step, lap = place
    if project.has_loop and step == project.loop_last and lap < project.loop_count:
        return Place(project.loop_first, lap + 1)  # the loop begins again in each pass # assumption
    if step >= len(project.used):
        return None
    return Place(step + 1, lap if step + 1 <= project.loop_last else 1)


def one_pass(project: Project) -> Iterator[Place]:
    """Every place of one pass of the project, in order."""
    place = Place(1) if project.used else None
    while place:
        yield place
        place = following(project, place)


def times(project: Project, step: int) -> int:
    """How often a step is carried out in one pass of the project."""
    return sum(place.step == step for place in one_pass(project))
