"""In which order the steps of a project come, how often, and how many pulses each has.

After step i: if the step loop is on, i is its last step and passes are left, on to its first step; else if i is the
last step, the pass of the project is over; else i + 1. The loop begins afresh in each pass, an assumption.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from math import floor
from typing import NamedTuple

from motorbus.families.stepper.execution.behaviour import USUAL, Behaviour
from motorbus.families.stepper.execution.profile import LOWEST_START, Motion, Ramp, motion, still
from motorbus.families.stepper.table import STEPS, Project, Step


class Place(NamedTuple):
    """Where in one pass of a project: the step, 1 to 10, and which pass of the step loop (1 before it and behind)."""

    step: int
    lap: int = 1


def laps(project: Project, how: Behaviour = USUAL) -> int:
    """How often the range of the step loop runs in one pass of the project: 1 when the loop is off."""
    if not project.loop_is_on:
        return 1
    return project.loop_count + (how.seg_loop == "extra")


def passes(project: Project, how: Behaviour = USUAL) -> int | None:
    """How often the whole project runs; None: until it is stopped."""
    if project.is_endless:
        return None
    return project.project_loop + 1 if how.proj_loop == "extra" else max(1, project.project_loop)


def last_step(project: Project) -> int:
    """The number of the last step that is carried out, 0 to 10."""
    return min(project.total_steps, STEPS)


def following(project: Project, place: Place, how: Behaviour = USUAL) -> Place | None:
    """What comes after this step in the same pass of the project, or None at its end."""
    step, lap = place
    if project.loop_is_on and step == project.loop_last and lap < laps(project, how):
        return Place(project.loop_first, lap + 1)
    if step >= last_step(project):
        return None
    return Place(step + 1, lap if project.loop_is_on and step + 1 <= project.loop_last else 1)


def one_pass(project: Project, how: Behaviour = USUAL) -> Iterator[Place]:
    """Every step of one pass of the project, in order."""
    place: Place | None = Place(1) if last_step(project) else None
    while place is not None:
        yield place
        place = following(project, place, how)


def times_in_a_pass(project: Project, step: int, how: Behaviour = USUAL) -> int:
    """How often this step is carried out in one pass of the project."""
    if not 1 <= step <= last_step(project):
        return 0
    looped = project.loop_is_on and project.loop_first <= step <= project.loop_last
    return laps(project, how) if looped else 1


def exact_pulses(project: Project, step: Step) -> Fraction:
    """Pulses for the distance of a step, without rounding; 0 when the project has no geometry."""
    return step.distance * (project.pulses_per_unit or Fraction(0))


def pulses(
    project: Project, step: Step, how: Behaviour = USUAL, residue: Fraction = Fraction(0)
) -> tuple[int, Fraction]:
    """Pulses a step sends, and what is left over for the next one (with rounding=carry; forward is positive).

    A step at speed 0 sends none, and leaves what is left over as it was.
    """
    if not frequency(project, step):
        return 0, residue
    exact = exact_pulses(project, step)
    if how.rounding == "nearest":
        return floor(exact + Fraction(1, 2)), residue
    if how.rounding != "carry":
        return floor(exact), residue
    wanted = exact + step.sign * residue
    sent = max(0, floor(wanted))
    return sent, step.sign * (wanted - sent)


def sent_in_all(project: Project, how: Behaviour = USUAL) -> dict[int, dict[int, int]]:
    """By step: how often it sends so many pulses, in all passes of the project, of an endless one in the first.

    Only with rounding=carry do executions of one step differ. With it, each of them is reckoned: 0.6 million at most.
    """
    numbers = range(1, last_step(project) + 1)
    turns = passes(project, how) or 1
    if how.rounding == "carry":
        return _carried(project, [place.step for place in one_pass(project, how)] * turns)
    return {
        number: {pulses(project, project.step(number), how)[0]: times_in_a_pass(project, number, how) * turns}
        for number in numbers
    }


def _carried(project: Project, run: list[int]) -> dict[int, dict[int, int]]:
    """What `pulses` says of each step of a run, in whole numbers: `left` counts parts of a pulse."""
    unit = project.pulses_per_unit or Fraction(0)
    parts, left = unit.denominator, 0
    found: dict[int, dict[int, int]] = {number: {} for number in sorted(set(run))}
    moves = {
        number: (step.sign, step.distance * unit.numerator, frequency(project, step) > 0)
        for number in found
        for step in [project.step(number)]
    }
    for number in run:
        sign, exact, turns = moves[number]
        wanted = exact + sign * left if turns else 0
        sent = max(0, wanted // parts)
        left = sign * (wanted - sent * parts) if turns else left
        found[number][sent] = found[number].get(sent, 0) + 1
    return found


def frequency(project: Project, step: Step) -> float:
    """Pulses per second at the running speed of a step."""
    return float(step.speed * (project.pulses_per_turn or Fraction(0)) / 60)


def ramp_of(step: Step, how: Behaviour = USUAL) -> Ramp:
    """How the frequency of a step grows."""
    start = float(step.start_frequency) or LOWEST_START
    if how.ramp == "pulse":
        return Ramp(start, float(step.acceleration), True)
    return Ramp(start, step.acceleration * 1000 / how.ramp_tick_ms, False)


def move(project: Project, step: Step, count: int | None, how: Behaviour = USUAL, sign: int = 0) -> Motion:
    """The motion of so many pulses (None: without an end) with the speed of this step; `sign` 0 is its direction."""
    if not frequency(project, step):
        return still(sign or step.sign, ramp_of(step, how))
    return motion(count, frequency(project, step), ramp_of(step, how), sign or step.sign)
