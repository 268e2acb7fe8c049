"""The order of the steps of a project, and how often it runs.

After the last step of the step loop follows its first, as often as the loop counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import floor
from typing import NamedTuple

from motorbus.families.stepper.execution.ramp import ramp_of
from motorbus.families.stepper.parameters import STEPS, Project, Step


class Place(NamedTuple):
    """A place in one pass of a project: the step, 1 to 10, and the pass of the step loop, from 1."""

    step: int
    lap: int = 1


def last_step(project: Project) -> int:
    """The number of the last step that is carried out, 0 to 10."""
    return min(project.total_steps, STEPS)


def passes(project: Project) -> int | None:
    """How often the project runs; None: until it is stopped."""
    return (
        None if project.is_endless else max(1, project.project_loop)
    )  # counts are totals, 0 is 1 # assumption


def following(project: Project, place: Place) -> Place | None:
    """The next place in the same pass of the project; None at its end."""
    step, lap = place
    if project.has_loop and step == project.loop_last and lap < project.loop_count:
        return Place(project.loop_first, lap + 1)  # the loop begins again in each pass # assumption
    if step >= last_step(project):
        return None
    return Place(step + 1, lap if step + 1 <= project.loop_last else 1)


def one_pass(project: Project) -> Iterator[Place]:
    """Every place of one pass of the project, in order."""
    place = Place(1) if last_step(project) else None
    while place:
        yield place
        place = following(project, place)


def times(project: Project, step: int) -> int:
    """How often a step is carried out in one pass of the project."""
    return sum(place.step == step for place in one_pass(project))


def earliest_end(project: Project) -> float | None:
    """Time (s) from the start before which a project cannot have ended, in any reading; None if it never ends.

    All its pauses, and all its pulses but one at the highest frequency. A step with a stop input counts with its pause
    only, a wait for an input with nothing.
    """
    count = passes(project)
    if count is None:
        return None
    return count * sum(_least(project, project.step(place.step)) for place in one_pass(project))


def _least(project: Project, step: Step) -> float:
    ramp = ramp_of(project, step)
    if step.stop_input or not ramp.run:
        return step.delay / 1000
    pulses = max(0, floor(step.distance * (project.pulses_per_unit or 0)) - 1)
    return step.delay / 1000 + pulses / max(ramp.run, ramp.start)
