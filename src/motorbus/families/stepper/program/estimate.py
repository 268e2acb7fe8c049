"""How long a project takes, and how far it goes, before it runs.

Motion and pauses are known but for the tick of the ramp. Waits for an input are counted, not guessed.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Final

from msgspec import Struct

from motorbus.families.stepper.execution import ramp
from motorbus.families.stepper.execution.ramp import TICK_MS
from motorbus.families.stepper.parameters import ENDLESS, Project, Step

COUNTLESS: Final = 1_000_000  # passes for which the travel of an endless project is given


class Estimate(Struct, frozen=True, kw_only=True):
    """The duration of a project.

    `seconds`  motion and pauses in all, of one pass of an endless project
    `waits`    how often it waits for an input; `cuts` how often a stop input may end a motion early
    """

    seconds: float
    waits: int
    cuts: int
    endless: bool

    def __str__(self) -> str:
        text = f"about {self.seconds:.1f} s" + " for each pass, endless" * self.endless
        if self.waits:
            text += f" + {self.waits} wait{'s' * (self.waits > 1)} for an input"
        if self.cuts:
            times = "once" if self.cuts == 1 else f"up to {self.cuts} times"
            text += f"; less where a stop input ends a step early, {times}"
        return text


def estimate(project: Project, tick_ms: float = TICK_MS) -> Estimate:
    """The duration of a project."""
    count = project.passes or 1
    steps = [(step, project.times(number) * count) for number, step in enumerate(project.used, 1)]
    return Estimate(
        seconds=sum(
            times * (ramp.move_of(project, step, tick_ms).duration + step.delay / 1000)
            for step, times in steps
        ),
        waits=sum(times for step, times in steps if step.start_input),
        cuts=sum(times for step, times in steps if step.stop_input and ramp.pulses_of(project, step)),
        endless=project.is_endless,
    )


def earliest_end(project: Project) -> float:
    """Time (s) from the start before which a project cannot have ended, with any ramp; infinite for an endless one.

    All its pauses, and all its pulses but one at the highest frequency. A step with a stop input counts with its pause
    only, a wait for an input with nothing.
    """
    count = project.passes
    if count is None:
        return inf
    return count * sum(_least(project, project.step(place.step)) for place in project.one_pass())


def _least(project: Project, step: Step) -> float:
    speed, pulses = ramp.ramp_of(project, step), ramp.pulses_of(project, step)
    if step.stop_input or not pulses:
        return step.delay / 1000
    return step.delay / 1000 + (pulses - 1) / max(speed.run, speed.start)


def reach(project: Project) -> tuple[int, int]:
    """Lowest and highest end of a step, in user units from the start, over all passes.

    A loop count may count repetitions: of both readings the farther ends. An endless project is given a million passes.
    """
    ends = [0]
    for count in (project.loop_count, min(ENDLESS - 1, project.loop_count + project.has_loop)):
        at, own = 0, [0]
        for place in replace(project, loop_count=count).one_pass():
            step = project.step(place.step)
            at += step.sign * step.distance if step.speed else 0
            own.append(at)
        drift = at * (COUNTLESS if project.is_endless else project.project_loop)
        ends += [*own, *(end + drift for end in own)]
    return min(ends), max(ends)


def net_units(project: Project) -> int:
    """The end of one pass in user units from its beginning; steps of less than one pulse do not count."""
    steps = [project.step(place.step) for place in project.one_pass()]
    return sum(step.sign * step.distance for step in steps if ramp.pulses_of(project, step))
