"""What a project will do, before it does it: in which order, how long, and where it ends.

A controller tells nothing while it works, so the plan is also the only progress there can be. Time has three parts:
motion and pauses, which are known but for the open questions; what an operator takes at an input, which nobody knows
and which is counted; and what a stop input may take away. So an estimate says "at least 41.6 s + 6 waits", which holds
for the readings it is made with, and then a band over those of the one constant that the manual leaves out: per what
the frequency grows.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf
from typing import Any, Final, NamedTuple

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program.lint import net_units
from motorbus.families.stepper.table import PARAMETERS, Project

SCHEMA: Final = "motorbus.stepper.plan/1"
READINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "per pulse": {"ramp": "pulse"},
    "per 1 ms": {"ramp": "time", "ramp_tick_ms": 1.0},
    "per 10 ms": {"ramp": "time", "ramp_tick_ms": 10.0},
}
"""The readings of the acceleration that give the manual's example a plausible move: 0.82 s, 0.69 s and 1.43 s."""


class StepPlan(NamedTuple):
    """One step: what it sends and how long it takes.

    `exact` are its pulses before rounding, and `runs` says how often in all it sends so many after it; `sent` is the
    most of them, which only with rounding=carry is not all there is. `frequency` and `peak` are Hz, wanted and reached;
    `motion` and `delay` s, the motion on average where runs differ; `times` how often it is carried out in a pass;
    `units` its signed distance.
    """

    number: int
    exact: Fraction
    sent: int
    runs: Mapping[int, int]
    frequency: float
    shape: str
    peak: float
    motion: float
    delay: float
    times: int
    units: int
    start_input: int
    stop_input: int
    output: int

    @property
    def seconds(self) -> float:
        """Motion and pause, once."""
        return self.motion + self.delay


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """How long a project takes.

    `seconds`  motion and pauses in all, of the first pass when it is `endless`
    `waits`    how often it waits for an input, in the same time, at least `seconds` being without them
    `cuts`     how often a stop input may end a motion early, so that it takes less
    `low`, `high`  the same in the readings of the acceleration, `readings` says each
    `stuck`    the first step that never ends by itself, 0 when each does
    `settled_by`  always ""; kept for those that read it
    """

    seconds: float
    waits: int
    cuts: int
    endless: bool
    readings: Mapping[str, float]
    stuck: int = 0
    settled_by: str = ""

    @property
    def low(self) -> float:
        """The shortest of the readings (s)."""
        return min((self.seconds, *self.readings.values()))

    @property
    def high(self) -> float:
        """The longest of the readings (s)."""
        return max((self.seconds, *self.readings.values()))

    def __str__(self) -> str:
        if self.stuck:
            return f"never ends: step {self.stuck}" + (", unless a stop input ends it" if self.cuts else "")
        waits = f" + {self.waits} wait{'s' if self.waits > 1 else ''}" if self.waits else ""
        text = f"at least {duration(self.seconds)}{waits}" + (
            " for each pass, without an end" if self.endless else ""
        )
        if duration(self.low) != duration(self.high):
            text += f"; {duration(self.low)} to {duration(self.high)} if the acceleration is meant otherwise"
        if self.cuts:
            times = "once" if self.cuts == 1 else f"{self.cuts} times"
            text += f"; less where a stop input ends a step early, {times} at most"
        return text

    def data(self) -> dict[str, Any]:
        """As plain data; a time without end is None."""
        return {
            "seconds": finite(self.seconds),
            "waits": self.waits,
            "cuts": self.cuts,
            "endless": self.endless,
            "low": finite(self.low),
            "high": finite(self.high),
            "readings": {name: finite(seconds) for name, seconds in self.readings.items()},
            "never_ends_at_step": self.stuck or None,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Everything that can be said of a project before it runs.

    `order` are the steps of one pass, `passes` how often (None: endless), `net_units` where a pass ends from where it
    began; `name` is that of the program.
    """

    name: str
    project: Project
    how: Behaviour
    steps: tuple[StepPlan, ...]
    order: tuple[int, ...]
    passes: int | None
    net_units: int
    estimate: Estimate

    @property
    def pass_seconds(self) -> float:
        """Motion and pauses of one pass, on average where carried pulses make them differ."""
        return sum(step.seconds * step.times for step in self.steps)

    def data(self) -> dict[str, Any]:
        """As plain data, with names and units in the keys."""
        turn = self.project.turn_distance
        return {
            "schema": SCHEMA,
            "name": self.name,
            "project": self.project.number,
            "order": list(self.order),
            "passes": self.passes,
            "pass_seconds": finite(self.pass_seconds),
            "net_units_per_pass": self.net_units,
            "net_turns_per_pass": self.net_units / turn if turn else None,
            "estimate": self.estimate.data() | {"text": str(self.estimate)},
            "steps": [_step_data(step) for step in self.steps],
        }

    def json(self) -> str:
        """As one JSON document."""
        return json.dumps(self.data(), indent=2, ensure_ascii=False) + "\n"


def finite(seconds: float) -> float | None:
    """None for a time without end, which JSON cannot say."""
    return None if seconds == inf else seconds


def plan(project: Project, how: Behaviour = USUAL, *, name: str = "") -> Plan:
    """The plan of a project, under the readings of `how`."""
    steps = _steps(project, how)
    return Plan(
        name=name,
        project=project,
        how=how,
        steps=steps,
        order=tuple(place.step for place in execution.one_pass(project, how)),
        passes=execution.passes(project, how),
        net_units=net_units(project, how),
        estimate=_estimate(project, how, steps),
    )


def estimate(project: Project, how: Behaviour = USUAL) -> Estimate:
    """How long a project takes, under the readings of `how`, with a band over the readings of the acceleration."""
    return _estimate(project, how, _steps(project, how))


def duration(seconds: float) -> str:
    """A time for people: 41.6 s, 4 min 12 s, 2 h 5 min."""
    if seconds == inf:
        return "for ever"
    if seconds < 99.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def _estimate(project: Project, how: Behaviour, steps: tuple[StepPlan, ...]) -> Estimate:
    times = execution.passes(project, how) or 1
    runs = {step.number: step.runs for step in steps}
    return Estimate(
        seconds=_in_all(steps) * times,
        waits=sum(step.times for step in steps if step.start_input) * times,
        cuts=sum(_motions(step) for step in steps if step.stop_input),
        endless=project.is_endless,
        readings={
            text: _in_all(_steps(project, replace(how, **changes), runs)) * times
            for text, changes in READINGS.items()
        },
        stuck=next((step.number for step in steps if step.motion == inf), 0),
    )


def _in_all(steps: tuple[StepPlan, ...]) -> float:
    return sum(step.seconds * step.times for step in steps)


def _motions(step: StepPlan) -> int:
    """How often in all it moves."""
    return sum(times for sent, times in step.runs.items() if sent or step.motion == inf)


def _steps(
    project: Project, how: Behaviour, runs: Mapping[int, Mapping[int, int]] | None = None
) -> tuple[StepPlan, ...]:
    """`runs` are its pulses where they are known already: how the frequency grows changes nothing in them."""
    known = execution.sent_in_all(project, how) if runs is None else runs
    return tuple(_step(project, number, how, known[number]) for number in known)


def _step(project: Project, number: int, how: Behaviour, runs: Mapping[int, int]) -> StepPlan:
    step, sent = project.step(number), max(runs)
    endless = not step.distance and how.zero_distance == "endless"
    moves = {count: execution.move(project, step, None if endless else count, how) for count in runs}
    move = moves[sent]
    return StepPlan(
        number=number,
        exact=execution.exact_pulses(project, step),
        sent=sent,
        runs=runs,
        frequency=execution.frequency(project, step),
        shape=move.shape,
        peak=move.peak,
        motion=_mean([(moves[count].duration, times) for count, times in runs.items()]),
        delay=step.delay / 1000,
        times=execution.times_in_a_pass(project, number, how),
        units=step.sign * step.distance,
        start_input=step.start_input,
        stop_input=step.stop_input,
        output=step.output,
    )


def _mean(durations: list[tuple[float, int]]) -> float:
    """Of durations and how often each comes; of a single one exactly that."""
    if len(durations) == 1:
        return durations[0][0]
    return sum(one * times for one, times in durations) / sum(times for _, times in durations)


def _step_data(step: StepPlan) -> dict[str, Any]:
    return {
        "step": step.number,
        "times_per_pass": step.times,
        "units": step.units,
        "pulses": step.sent,
        "pulses_at_least": min(step.runs),
        "pulses_exact": float(step.exact),
        "frequency_hz": step.frequency,
        "peak_hz": step.peak,
        "shape": step.shape,
        "motion_seconds": step.motion if step.motion != inf else None,
        "delay_seconds": step.delay,
        "wait_for_input": step.start_input or None,
        "stop_on_input": step.stop_input or None,
        "output": PARAMETERS["output"].choices.get(step.output, f"action {step.output}"),
    }
