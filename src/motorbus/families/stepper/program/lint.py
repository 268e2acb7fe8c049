"""Rules for a project: what does not do what it seems to say. A rule changes and refuses nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal, TypeAlias

from msgspec import Struct

from motorbus.families.stepper import parameters
from motorbus.families.stepper.execution import ramp
from motorbus.families.stepper.parameters import PARAMETERS, Project, Step
from motorbus.families.stepper.program.estimate import net_units

Level: TypeAlias = Literal["error", "warning", "note"]

RULES: Final[dict[str, tuple[Level, str]]] = {
    "L1": ("error", "without steps, angle, microsteps and distance of a turn the motor does not move"),
    "L2": ("error", "no request can carry it"),
    "L3": ("warning", "the part of a pulse is lost, an assumption"),
    "L4": ("warning", "the motor may not follow this frequency"),
    "L5": ("error", "without a start frequency below the running frequency there is no ramp, or no motion"),
    "L6": ("warning", "the motor is at full speed at once and may lose steps"),
    "L7": ("warning", "the distance is too short for both ramps"),
    "L8": ("warning", "the step has no distance, no pause and no output"),
    "L9": ("warning", "the step loop is ignored, an assumption, or repeats nothing"),
    "L10": ("note", "only a stop ends the project, and no notice comes"),
    "L11": ("warning", "a pass does not end where it began, and there are more passes"),
    "L12": ("error", "inputs 3 and 4 start and stop projects"),
    "L13": ("warning", "input 5 is the home switch too"),
    "L14": ("warning", "one input starts and ends the step: its motion ends at its beginning"),
    "L15": ("warning", "the output stays on after the project"),
    "L16": ("note", "jog, single move and homing run with step 1 of project 1"),
    "L17": ("warning", "the motor moves at power-on: keep clear"),
    "L19": ("warning", "a delay is in ms, and empty memory reads FF FF FF"),
    "L21": ("warning", "the manual does not explain mode 4"),
}
"""Level and reason of each rule; numbers that are missing were rules of earlier versions."""
HIGHEST: Final = 100_000.0  # Hz that a motor driver follows # assumption
LONG_PAUSE: Final = 3_600_000  # ms
LONG_PAUSES: Final = 8 * 3_600_000  # ms, of a run, or of one pass of an endless project
_Found: TypeAlias = Iterator[tuple[str, str]]


class Finding(Struct, frozen=True):
    """A finding of a rule at a step (0: of the project)."""

    rule: str
    level: Level
    step: int
    text: str
    reason: str

    def __str__(self) -> str:
        where = f"step {self.step}: " if self.step else ""
        return f"{self.rule} {self.level}: {where}{self.text} ({self.reason})"


def lint(project: Project) -> list[Finding]:
    """All findings: those of the project first, then by step."""
    if project.is_cleared:
        return [_finding("L1", 0, "the project has no steps")]
    found = [(0, *one) for one in _of_project(project)]
    for number, step in enumerate(project.used, 1):
        found += [(number, *one) for one in _motion(project, step, number)]
        found += [(number, *one) for one in _pauses_and_inputs(project, step)]
    return [_finding(rule, number, text) for number, rule, text in found]


def _finding(rule: str, step: int, text: str) -> Finding:
    level, reason = RULES[rule]
    return Finding(rule, level, step, text, reason)


def _of_project(project: Project) -> _Found:
    for name in ("step_angle", "microsteps", "turn_distance"):
        if not getattr(project, name):
            yield "L1", f"{name} is 0"
    for error in parameters.check_project(project, expert=True):
        yield "L2", error.summary
    first, last, count = project.loop_first, project.loop_last, project.loop_count
    if (first or last or count) and not project.has_loop:
        yield "L9", f"steps {first} to {last} of {project.total_steps}, count {count}"
    elif count == 1:
        yield "L9", f"steps {first} to {last} run once"
    if project.is_endless:
        yield "L10", "the project loop is 255"
    passes, net = project.passes, net_units(project)
    if net and passes != 1:
        total = f", {net * passes:+d} after {passes} passes" if passes else ""
        yield "L11", f"{net:+d} units in each pass{total}"
    outputs = 0
    for step in project.used:
        outputs = parameters.outputs_after_step(outputs, step.output)
    if outputs:
        yield "L15", f"output {', '.join(str(n) for n in (1, 2, 3) if outputs >> n - 1 & 1)}"
    if project.number == 1:
        step = project.step(1)
        yield "L16", f"at {step.speed} rpm, from {step.start_frequency} Hz by {step.acceleration} Hz"
    if project.power_on_home:
        yield "L17", "in reverse until input 5, without a limit of travel or time"
    pauses = sum(project.step(place.step).delay for place in project.one_pass()) * (passes or 1)
    if pauses > LONG_PAUSES:
        yield "L19", f"{pauses / 1000:g} s of pauses in all"
    if project.mode4:
        yield "L21", f"mode 4 is {project.mode4}"


def _motion(project: Project, step: Step, number: int) -> _Found:
    if not step.distance or project.pulses_per_unit is None or project.pulses_per_turn is None:
        return
    speed = ramp.ramp_of(project, step)
    if not speed.run:
        yield "L5", "speed 0"
        return
    exact, pulses = step.distance * project.pulses_per_unit, ramp.pulses_of(project, step)
    if exact != pulses:
        times = project.times(number) * (project.passes or 1)
        lost = float(exact - pulses) * times
        yield "L3", f"{float(exact):.6g} pulses, {lost:.3g} lost in {times} executions"
    if speed.run > HIGHEST:
        yield "L4", f"{step.speed} rpm are {speed.run:.6g} Hz, more than {HIGHEST:g} Hz"
    if not step.start_frequency or step.start_frequency >= speed.run:
        yield "L5", f"start {step.start_frequency} Hz, running {speed.run:.6g} Hz"
    if not step.acceleration:
        yield "L6", "acceleration 0"
    peak = ramp.motion(speed, pulses, 1).peak
    if pulses and peak < speed.run:
        yield "L7", f"{peak * 60 / float(project.pulses_per_turn):.4g} rpm at most, {step.speed} rpm wanted"


def _pauses_and_inputs(project: Project, step: Step) -> _Found:
    if not (step.distance or step.delay or step.output):
        yield "L8", "only a wait" if step.start_input else "nothing at all"
    if step.delay == PARAMETERS["delay"].high or step.delay > LONG_PAUSE:
        yield "L19", f"a pause of {step.delay / 1000:.10g} s"
    inputs = (step.start_input, step.stop_input)
    for port in inputs:
        if port in (parameters.START_INPUT, parameters.STOP_INPUT):
            yield "L12", f"input {port}"
    if project.power_on_home and parameters.HOME_INPUT in inputs:
        yield "L13", "input 5"
    if step.start_input and step.start_input == step.stop_input:
        yield "L14", f"input {step.start_input}"
