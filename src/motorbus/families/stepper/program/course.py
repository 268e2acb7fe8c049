"""What a project does over time, as data for a picture: position, speed, outputs and inputs, moment by moment.

It is the machine itself that runs, with somebody at every input who takes so long, so a picture shows what the
simulator would do. Samples lie where something changes, and evenly between, so that a thousand of them show four hours
as well as four seconds.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import Any, Final, NamedTuple

from motorbus.errors import RequestError
from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import USUAL, Behaviour, Happening, Phase, State
from motorbus.families.stepper.table import INPUTS, OUTPUTS, Project

MOST: Final = 100_000
"""Phases that a course may have; an endless project is cut off by its passes long before."""


class Stretch(NamedTuple):
    """One phase of a run, from `begin` to `end` (s), and what the controller is meanwhile."""

    begin: float
    end: float
    state: State

    @property
    def step(self) -> int:
        """The step it belongs to, 0 for none."""
        return self.state.run.place.step if self.state.run else 0


@dataclass(frozen=True, slots=True)
class Course:
    """A run from its beginning: every stretch, and everything that happened."""

    stretches: tuple[Stretch, ...]
    told: tuple[Happening, ...]

    @property
    def seconds(self) -> float:
        """When it is over, waits included."""
        return self.stretches[-1].end if self.stretches else 0.0

    def samples(self, count: int = 1000) -> dict[str, list[Any]]:
        """Columns of equal length: time (s), pulses, hertz (negative in reverse), step, phase, outputs, inputs.

        At each change there are two samples of one moment, before and after, so that lines are upright.
        """
        columns: dict[str, list[Any]] = {
            name: [] for name in ("time", "pulses", "hertz", "step", "phase", "outputs", "inputs")
        }
        even = [self.seconds * n / max(1, count) for n in range(count + 1)]
        for stretch in self.stretches:
            for at in _moments(stretch, even):
                state = stretch.state
                late = at >= stretch.end > stretch.begin  # as it was just before, not at rest already
                columns["time"].append(at)
                columns["pulses"].append(state.position(at))
                columns["hertz"].append(state.frequency(at - 1e-9 * max(1.0, at) if late else at))
                columns["step"].append(stretch.step)
                columns["phase"].append(state.phase.value)
                columns["outputs"].append(state.outputs)
                columns["inputs"].append(sorted(state.inputs))
        return columns


class Picture(NamedTuple):
    """A course as one draws it: times (s), curves by the label of their axis, lanes, and spans.

    A span is when it begins, when it ends, what stands above it, and whether it is a wait.
    """

    times: list[float]
    curves: dict[str, list[float]]
    lanes: dict[str, list[bool]]
    spans: list[tuple[float, float, str, bool]]


def picture(
    course: Course,
    project: Project,
    *,
    inputs: Mapping[str, int] | None = None,
    outputs: Mapping[str, int] | None = None,
    lead: Fraction | None = None,
    count: int = 1000,
) -> Picture:
    """What one draws of a course: position in turns (mm where a `lead` is given), speed in RPM, outputs and inputs.

    Outputs and inputs are called by their names. There is a lane for each that has one, that a step mentions, or that
    changes; switching all of them off mentions none.
    """
    mentioned = _mentioned(project)
    columns = course.samples(count)
    turn = float(project.pulses_per_turn or 1)
    scale, label = (float(lead) / turn, "position (mm)") if lead else (1 / turn, "position (turns)")
    curves = {
        label: [pulses * scale for pulses in columns["pulses"]],
        "speed (rpm)": [hertz * 60 / turn for hertz in columns["hertz"]],
    }
    lanes: dict[str, list[bool]] = {}
    for port in range(1, OUTPUTS + 1):
        levels = [bool(bits >> port - 1 & 1) for bits in columns["outputs"]]
        wanted = port in (outputs or {}).values() or ("output", port) in mentioned
        _lane(lanes, _called(port, "output", outputs), levels, wanted=wanted)
    for port in range(1, INPUTS + 1):
        levels = [port in active for active in columns["inputs"]]
        wanted = port in (inputs or {}).values() or ("input", port) in mentioned
        _lane(lanes, _called(port, "input", inputs), levels, wanted=wanted)
    return Picture(columns["time"], curves, lanes, _spans(course))


def _called(port: int, kind: str, names: Mapping[str, int] | None) -> str:
    return next((name for name, other in (names or {}).items() if other == port), f"{kind} {port}")


def _mentioned(project: Project) -> set[tuple[str, int]]:
    """The outputs and inputs of which a step that is carried out says something."""
    found: set[tuple[str, int]] = set()
    for number in range(1, execution.last_step(project) + 1):
        step = project.step(number)
        found |= {("output", port) for port in range(1, OUTPUTS + 1) if step.output in (port, port + 4)}
        found |= {("input", port) for port in (step.start_input, step.stop_input) if port}
    return found


def _lane(lanes: dict[str, list[bool]], name: str, levels: list[bool], *, wanted: bool) -> None:
    if wanted or any(levels):
        lanes[name] = levels


def _spans(course: Course) -> list[tuple[float, float, str, bool]]:
    """One for each execution of a step, its wait apart."""
    spans: list[tuple[float, float, str, bool]] = []
    before: object = None
    for begin, end, state in course.stretches:
        run = state.run
        waiting = state.phase is Phase.WAIT
        mark = (run.place, run.round, waiting) if run else None
        name = "wait" if waiting else str(run.place.step if run else "")
        if mark == before and spans:
            spans[-1] = (spans[-1][0], end, name, waiting)
        else:
            spans.append((begin, end, name, waiting))
        before = mark
    return spans


def course(
    project: Project,
    how: Behaviour = USUAL,
    *,
    wait: float = 1.0,
    passes: int = 1,
    held: float = 0.1,
    most: int = MOST,
) -> Course:
    """Run a project with an operator who takes `wait` s at each input and holds it for `held` s.

    An endless project is cut off after so many `passes`. Raises RequestError when it has more than `most` phases.
    """
    state = execution.power_on(0.0, how).state
    found = execution.start(state, project, 0.0)
    stretches: list[Stretch] = []
    told = list(found.told)
    for begin, end, now in _phases(found.state, wait, held, told):
        if now.run is not None and project.is_endless and now.run.round > passes:
            break
        if end > begin:
            stretches.append(Stretch(begin, end, now))
        if len(stretches) > most:
            raise RequestError(
                f"this project has more than {most} phases",
                advice="draw one pass: lower `repeat` or the loop count",
            )
    end = stretches[-1].end if stretches else 0.0
    return Course(tuple(stretches), tuple(one for one in told if one.at <= end))


def _phases(
    state: State, wait: float, held: float, told: list[Happening]
) -> Iterator[tuple[float, float, State]]:
    """Each phase with its beginning and end, the operator's hand on the inputs included."""
    now, release = state.since, inf
    port = 0
    while state.busy:
        waiting = state.phase is Phase.WAIT
        due = state.since + wait if waiting else execution.due(state)
        if waiting and release < inf:
            due = max(due, release)  # the hand is still there: it lets go before it presses again
        end = max(now, min(due, release))
        if end == inf:
            raise RequestError(
                f"step {state.run.place.step if state.run else 0} never ends",
                cause="with zero_distance=endless a step of distance 0 moves until it is stopped",
            )
        yield now, end, state
        if release <= end:
            found = execution.set_input(state, port, False, end)
            release = inf
        elif waiting and state.run is not None:
            port = state.run.step.start_input
            found = execution.set_input(state, port, True, end)
            release = end + held
        else:
            found = execution.advance(state, end)
        told += found.told
        state, now = found.state, end


def _moments(stretch: Stretch, even: Sequence[float]) -> Iterable[float]:
    inside = even[bisect_right(even, stretch.begin) : bisect_right(even, stretch.end)]
    return [stretch.begin, *(at for at in inside if at < stretch.end), stretch.end]
