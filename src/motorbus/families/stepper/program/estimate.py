"""How long a project takes, and how far it goes, before it runs.

Motion and pauses are known but for the reading of the acceleration. Waits for an input are counted, not guessed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from msgspec import Struct

from motorbus.families.stepper.execution import ramp, sequence
from motorbus.families.stepper.execution.ramp import READINGS, TICK_MS
from motorbus.families.stepper.parameters import ENDLESS, Project, Step

COUNTLESS: Final = 1_000_000  # passes for which the travel of an endless project is given


class Estimate(Struct, frozen=True, kw_only=True):
    """The duration of a project.

    `seconds`  motion and pauses in all, of one pass of an endless project; `low` and `high` in other readings of the
               acceleration
    `waits`    how often it waits for an input; `cuts` how often a stop input may end a motion early
    """

    seconds: float
    low: float
    high: float
    waits: int
    cuts: int
    endless: bool

    def __str__(self) -> str:
        waits = f" + {self.waits} wait{'s' * (self.waits > 1)}" if self.waits else ""
        text = f"at least {self.seconds:.1f} s{waits}" + " for each pass, endless" * self.endless
        band = f"{self.low:.1f} s to {self.high:.1f} s"
        text += f"; {band} in other readings of the acceleration" * (self.low < self.high)
        if self.cuts:
            times = "once" if self.cuts == 1 else f"{self.cuts} times"
            text += f"; less where a stop input ends a step early, {times} at most"
        return text


def estimate(project: Project) -> Estimate:
    """The duration of a project."""
    count = sequence.passes(project) or 1
    steps = [(project.step(n), sequence.times(project, n) * count) for n in numbers(project)]
    readings = [_seconds(project, steps, tick) for tick in READINGS.values()]
    return Estimate(
        seconds=_seconds(project, steps, TICK_MS),
        low=min(readings),
        high=max(readings),
        waits=sum(times for step, times in steps if step.start_input),
        cuts=sum(times for step, times in steps if step.stop_input and ramp.pulses_of(project, step)),
        endless=project.is_endless,
    )


def _seconds(project: Project, steps: list[tuple[Step, int]], tick_ms: float) -> float:
    return sum(times * (step_seconds(project, step, tick_ms) + step.delay / 1000) for step, times in steps)


def step_seconds(project: Project, step: Step, tick_ms: float = TICK_MS) -> float:
    """Duration (s) of the motion of a step."""
    return ramp.duration(ramp.ramp_of(project, step), ramp.pulses_of(project, step), tick_ms)


def numbers(project: Project) -> range:
    """The numbers of the steps that are carried out."""
    return range(1, sequence.last_step(project) + 1)


def net_units(project: Project) -> int:
    """The end of one pass in user units from its beginning; steps of less than one pulse do not count."""
    moves = [n for n in numbers(project) if ramp.pulses_of(project, project.step(n))]
    return sum(project.step(n).sign * project.step(n).distance * sequence.times(project, n) for n in moves)


def reach(project: Project) -> tuple[int, int]:
    """Lowest and highest end of a step, in user units from the start, over all passes.

    Of both readings of the loop counts the one that reaches farther; an endless project is given a million passes.
    """
    ends = [0]
    for extra in (0, 1):
        count = min(ENDLESS - 1, project.loop_count + extra * project.has_loop)
        at, own = 0, [0]
        for place in sequence.one_pass(replace(project, loop_count=count)):
            step = project.step(place.step)
            at += step.sign * step.distance if step.speed else 0
            own.append(at)
        drift = at * (COUNTLESS if project.is_endless else project.project_loop)
        ends += [*own, *(end + drift for end in own)]
    return min(ends), max(ends)
