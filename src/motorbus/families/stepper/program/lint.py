"""What in a project will not do what it seems to say, each finding by a rule with its reason.

A rule never changes anything and never refuses: what cannot be sent at all is refused elsewhere. Most of them are about
what nobody sees until a motor has run for an hour: a pulse lost in every pass, a speed that is never reached, a walk
away from where it began.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.table import (
    ENDLESS,
    HOME_INPUT,
    PARAMETERS,
    STEP_INPUTS,
    STEP_NAMES,
    STEPS,
    Project,
    Step,
    after_step,
    refusal,
    reserved_bytes,
)
from motorbus.families.stepper.wire import REPLY_LENGTH

_OF_JOG: Final = ("distance", "direction", "start_frequency", "acceleration", "speed")
_OF_MOTOR: Final = ("microsteps", "step_angle", "turn_distance")
"""What of step 1 and of its project manual motion runs with."""


class Rule(NamedTuple):
    """One rule: how grave a finding is ("error", "warning" or "note"), what it is about, and why it matters."""

    level: str
    title: str
    reason: str


RULES: Final[Mapping[str, Rule]] = MappingProxyType(
    {
        "L1": Rule("error", "no geometry", "without angle, microsteps and distance of a turn nothing moves"),
        "L2": Rule("warning", "pulses of a turn are not whole", "no number of turns is met exactly"),
        "L3": Rule(
            "warning",
            "pulses of a step are not whole",
            "what is done with the rest is an assumption: --rounding",
        ),
        "L4": Rule("warning", "the frequency is high", "what turns the motor may not follow so many pulses"),
        "L5": Rule(
            "error",
            "start frequency is 0 or not below the running frequency",
            "then there is no ramp, or no motion",
        ),
        "L6": Rule(
            "warning", "no acceleration", "the motor is to be at full speed at once, and may lose steps"
        ),
        "L7": Rule("warning", "the speed is never reached", "the distance is too short for both ramps"),
        "L8": Rule("warning", "a step that does nothing", "no distance, no pause, no output"),
        "L9": Rule(
            "warning", "the step loop does nothing", "a range that is none is ignored, or so it is assumed"
        ),
        "L10": Rule("note", "endless", "only a stop ends it, and no notice ever comes"),
        "L11": Rule(
            "warning", "it walks away", "a pass does not end where it began, and there are more passes"
        ),
        "L12": Rule("error", "an input that is not for steps", "inputs 3 and 4 start and stop projects"),
        "L13": Rule("warning", "input 5 is used twice", "it is the home switch too"),
        "L14": Rule(
            "warning", "one input starts and ends a step", "active, it ends the motion when it begins"
        ),
        "L15": Rule(
            "warning", "an output is switched on and never off", "it stays on when the project is over"
        ),
        "L16": Rule("note", "jog depends on it", "jog, single move and homing run with step 1 of project 1"),
        "L17": Rule("warning", "it homes at power-on", "the motor moves when the supply comes: keep clear"),
        "L18": Rule(
            "note", "bytes that nobody knows are not 0", "they cannot be written, so a copy differs in them"
        ),
        "L19": Rule(
            "warning",
            "long pauses",
            "a delay is in ms, FF FF FF is what empty memory holds, and loops multiply",
        ),
        "L20": Rule("note", "steps behind the last one are filled", "they are stored and not carried out"),
        "L21": Rule("warning", "mode 4 is not 0", "nobody knows what it does"),
        "L22": Rule("warning", "it waits for an input", "there is no timeout, and nobody is there"),
        "L23": Rule(
            "note",
            "the motor is told otherwise",
            "a driver that is set by the microsteps would be set otherwise too",
        ),
    }
)
"""Every rule by its name."""


class Finding(NamedTuple):
    """What a rule found: at which step (0: of the project), and what in particular."""

    rule: str
    step: int
    text: str

    @property
    def level(self) -> str:
        return RULES[self.rule].level

    @property
    def reason(self) -> str:
        return RULES[self.rule].reason

    def __str__(self) -> str:
        where = f"step {self.step}: " if self.step else ""
        return f"{self.rule} {self.level}: {where}{RULES[self.rule].title}: {self.text} ({self.reason})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What a project is judged against.

    `highest`     Hz the driver follows
    `longest`     s that a pause may have: an hour, unless said otherwise
    `longest_total`  s that all pauses of a run may have together (of a pass, when it is endless): eight hours
    `homing`      whether input 5 is used for homing, which power-on homing always does
    `unattended`  whether nobody is there to press a button
    `before`      what project 1 holds now, when this is to replace it; None: nobody has said
    `image`       the 220 bytes it came from, for what no field names
    `motor`       how its file names the motor, where the controller is told otherwise
    """

    highest: float = 100_000.0
    longest: float = 3600.0
    longest_total: float = 28_800.0
    homing: bool = False
    unattended: bool = False
    before: Project | None = None
    image: bytes = b""
    motor: str = ""
    how: Behaviour = USUAL


USUALLY: Final = Conditions()


def lint(project: Project, conditions: Conditions = USUALLY) -> list[Finding]:
    """Every finding, those of the project first, then step by step."""
    found = [finding for rule in _OF_PROJECT for finding in rule(project, conditions)]
    for number in range(1, execution.last_step(project) + 1):
        for rule in _OF_STEP:
            found += [
                Finding(name, number, text)
                for name, text in rule(project, project.step(number), number, conditions)
            ]
    return found


# --- of the project -------------------------------------------------------------------------------------------------


def _geometry(project: Project, _: Conditions) -> Iterator[Finding]:
    if project == Project(number=project.number):
        yield Finding("L1", 0, "the project has been cleared: it has no steps either")
        return
    if project.is_cleared:
        yield Finding("L8", 0, "the project has no steps: it has been cleared, and not selected since")
    for name in ("step_angle", "microsteps", "turn_distance"):
        if not getattr(project, name):
            yield Finding("L1", 0, f"{name} is 0")
    if project.step_angle and 36000 % project.step_angle:
        turn = project.pulses_per_turn
        whole = turn is not None and turn.denominator == 1
        pulses = f", {float(turn):.6g} pulses a turn" if turn is not None else ""
        text = f"360 / {project.step_angle / 100:g} degrees is not a whole number of full steps{pulses}"
        yield Finding("L2", 0, text + (", which is whole" if whole else ""))


def _told(_: Project, conditions: Conditions) -> Iterator[Finding]:
    if conditions.motor:
        yield Finding("L23", 0, conditions.motor)


def _loops(project: Project, _: Conditions) -> Iterator[Finding]:
    first, last, count = project.loop_first, project.loop_last, project.loop_count
    if (first or last) and not 1 <= first <= last <= project.total_steps:
        yield Finding("L9", 0, f"steps {first} to {last} of {project.total_steps} are no range")
    elif first and count in (0, 1):
        yield Finding("L9", 0, f"steps {first} to {last} with count {count} run once, as without a loop")
    elif count == ENDLESS:
        yield Finding("L9", 0, "count 255 is not defined for steps")
    elif count and not first:
        yield Finding("L9", 0, f"count {count} without a range")
    if project.is_endless:
        yield Finding("L10", 0, "the project loop is 255")


def _walk(project: Project, conditions: Conditions) -> Iterator[Finding]:
    net = net_units(project, conditions.how)
    if net and execution.passes(project, conditions.how) != 1:
        turns = f", {net / project.turn_distance:.6g} turns" if project.turn_distance else ""
        passes = execution.passes(project, conditions.how)
        total = f"; {net * passes} units after {passes} passes" if passes else ""
        yield Finding("L11", 0, f"{net:+d} units in each pass{turns}{total}")


def _outputs(project: Project, conditions: Conditions) -> Iterator[Finding]:
    outputs, ever = 0, 0
    for number in range(1, execution.last_step(project) + 1):
        zero = conditions.how.output_zero == "off"
        outputs = after_step(outputs, project.step(number).output, zero_is_off=zero)
        ever |= outputs
    left = [number for number in (1, 2, 3) if outputs & ever & 1 << number - 1]
    if left and conditions.how.outputs_on_stop != "off":
        yield Finding("L15", 0, f"output {', '.join(map(str, left))}")


def _manual(project: Project, conditions: Conditions) -> Iterator[Finding]:
    if project.number == 1 and (told := _jog(project, conditions.before)):
        yield Finding("L16", 1, told)
    if project.power_on_home:
        yield Finding("L17", 0, "in reverse until input 5, with no limit of travel or time")
    if project.mode4:
        yield Finding("L21", 0, f"variant {project.mode4}")


def _jog(project: Project, before: Project | None) -> str:
    """What manual motion is to run with from now on; "" when that is known not to change."""
    step = project.step(1)
    if before is None:
        return (
            f"from now on they go at {step.speed} rpm, from {step.start_frequency} Hz on by {step.acceleration} Hz; "
            "whether that is a change, --before tells"
        )
    mine = {name: getattr(step, name) for name in _OF_JOG} | {n: getattr(project, n) for n in _OF_MOTOR}
    old = before.step(1)
    theirs = {name: getattr(old, name) for name in _OF_JOG} | {n: getattr(before, n) for n in _OF_MOTOR}
    return ", ".join(
        f"{name} {theirs[name]} becomes {mine[name]}" for name in mine if mine[name] != theirs[name]
    )


def _pauses(project: Project, conditions: Conditions) -> Iterator[Finding]:
    passes = execution.passes(project, conditions.how)
    times = {n: execution.times_in_a_pass(project, n, conditions.how) for n in _carried_out(project)}
    total = sum(project.step(n).delay * often for n, often in times.items()) * (passes or 1) / 1000
    if total > conditions.longest_total:
        where = "in each pass" if passes is None else "in all"
        yield Finding("L19", 0, f"{total:g} s of pauses {where}, more than {conditions.longest_total:g} s")


def _rest(project: Project, conditions: Conditions) -> Iterator[Finding]:
    if conditions.image and (extra := reserved_bytes(conditions.image)):
        shown = ", ".join(
            f"{value:02X} at byte {REPLY_LENGTH + at} of the dump" for at, value in sorted(extra.items())
        )
        yield Finding("L18", 0, shown)
    filled = [n for n in range(execution.last_step(project) + 1, STEPS + 1) if project.step(n) != Step()]
    if filled:
        wrong = "".join(f"; {one}" for number in filled for one in _impossible(project.step(number), number))
        yield Finding("L20", 0, f"step {', '.join(map(str, filled))}{wrong}")


def _impossible(step: Step, number: int) -> Iterator[str]:
    for name in STEP_NAMES:
        if (error := refusal(name, getattr(step, name), step=number, expert=True)) is not None:
            yield f"{error.summary} ({error.expected})"


_OF_PROJECT: Final[tuple[Callable[[Project, Conditions], Iterator[Finding]], ...]] = (
    _geometry,
    _told,
    _loops,
    _walk,
    _outputs,
    _manual,
    _pauses,
    _rest,
)


def net_units(project: Project, how: Behaviour = USUAL) -> int:
    """Where one pass of a project ends, in user units from where it began, forward positive.

    What moves nothing, at speed 0 or with less than one pulse, does not count; parts of a pulse are told by L3.
    """
    return sum(
        project.step(n).sign * project.step(n).distance * execution.times_in_a_pass(project, n, how)
        for n in _carried_out(project)
        if _moves(project, project.step(n), how)
    )


def _carried_out(project: Project) -> range:
    return range(1, execution.last_step(project) + 1)


def _moves(project: Project, step: Step, how: Behaviour) -> bool:
    """Whether a step ever sends a pulse; one that is carried on is sent in the end."""
    turns = execution.frequency(project, step) > 0
    return turns and (how.rounding == "carry" or execution.pulses(project, step, how)[0] > 0)


# --- of one step ----------------------------------------------------------------------------------------------------

_Found = Iterator[tuple[str, str]]


def _pulses(project: Project, step: Step, number: int, conditions: Conditions) -> _Found:
    exact, how = execution.exact_pulses(project, step), conditions.how
    if exact.denominator == 1 or not execution.frequency(project, step):
        return
    each = f"{float(exact):.6g} pulses"
    if how.rounding == "carry":
        yield "L3", f"{each}, the rest of less than one is carried on to the next step"
        return
    off = exact - execution.pulses(project, step, how)[0]
    times, passes = execution.times_in_a_pass(project, number, how), execution.passes(project, how)
    drift = f", {_off(off * times)} in a pass" if times > 1 else ""
    total = f", {_off(off * times * passes)} in all" if passes and passes > 1 else ""
    yield "L3", f"{each}, {_off(off)} each time{drift}{total}"


def _off(pulses: Fraction) -> str:
    return f"{abs(float(pulses)):.3g} {'lost' if pulses > 0 else 'too many'}"


def _frequencies(project: Project, step: Step, number: int, conditions: Conditions) -> _Found:
    if not step.distance or project.pulses_per_unit is None:
        return  # no motion is meant, or L1 has told why there is none
    run = execution.frequency(project, step)
    if not run:
        yield "L5", "speed 0: the motor does not turn, and the distance is not gone"
        return
    if run > conditions.highest:
        yield "L4", f"{step.speed} rpm are {run:.6g} Hz, more than {conditions.highest:g} Hz"
    if not step.start_frequency or step.start_frequency >= run:
        yield "L5", f"start {step.start_frequency} Hz, running {run:.6g} Hz"
    if not step.acceleration:
        yield "L6", "acceleration 0"
    sent, _ = execution.pulses(project, step, conditions.how)
    move = execution.move(project, step, sent, conditions.how)
    if move.shape == "triangle" and project.pulses_per_turn:
        peak = move.peak * 60 / float(project.pulses_per_turn)
        yield "L7", f"{peak:.4g} rpm at most, {step.speed} rpm wanted"


def _idle(project: Project, step: Step, number: int, conditions: Conditions) -> _Found:
    if not (step.distance or step.delay or step.output):
        yield "L8", "only a wait" if step.start_input else "nothing at all"
    most = PARAMETERS["delay"].high
    if step.delay == most:
        yield "L19", f"{most / 1000:.3f} s, the most that can be said (raw {most}, FF FF FF)"
    elif step.delay / 1000 > conditions.longest:
        yield "L19", f"{step.delay / 1000:.10g} s, more than {conditions.longest:g} s"


def _inputs(project: Project, step: Step, number: int, conditions: Conditions) -> _Found:
    used = {"start": step.start_input, "stop": step.stop_input}
    for name, port in used.items():
        if port and port not in STEP_INPUTS:
            yield "L12", f"{name} input {port}"
    if HOME_INPUT in used.values() and (conditions.homing or project.power_on_home):
        yield (
            "L13",
            "as " + " and ".join(f"{name} input" for name, port in used.items() if port == HOME_INPUT),
        )
    if step.start_input and step.start_input == step.stop_input:
        yield "L14", f"input {step.start_input}"
    if step.start_input and conditions.unattended:
        yield "L22", f"input {step.start_input}"


_OF_STEP: Final[tuple[Callable[[Project, Step, int, Conditions], _Found], ...]] = (
    _pulses,
    _frequencies,
    _idle,
    _inputs,
)
