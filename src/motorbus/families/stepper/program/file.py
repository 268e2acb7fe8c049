"""A project as a TOML file with units and names; `ProgramFile` is its schema.

Conversion is exact: a value that is no whole number of what the controller counts is an error that gives the two
neighbours. Errors name the step and the field.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import ceil, floor
from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta, Struct

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.families.stepper import parameters
from motorbus.families.stepper.parameters import ENDLESS, INPUTS, PARAMETERS, STEPS, Order, Project, Step
from motorbus.families.stepper.program.estimate import Estimate, estimate
from motorbus.families.stepper.program.lint import Finding, lint
from motorbus.families.stepper.protocol import DUMP_LENGTH, HEADER, READ_PROJECT, REPLY_LENGTH

_QUANTITY: Final = re.compile(
    r"\s*([+-]?(?:\d{1,20}(?:\.\d{0,20})?|\.\d{1,20}))\s*([^\d\s.].*?)\s*", re.ASCII
)
_SAME: Final = {"unit": "units", "pulse": "pulses", "turn": "turns", "°": "deg", "RPM": "rpm"}
_LENGTH: Final = {"mm": Fraction(1), "um": Fraction(1, 1000), "cm": Fraction(10), "m": Fraction(1000)}
_TIME: Final = {"ms": Fraction(1), "s": Fraction(1000), "min": Fraction(60_000), "h": Fraction(3_600_000)}
_HERTZ: Final = {"Hz": Fraction(1), "kHz": Fraction(1000)}
_Each = Mapping[str, Fraction]


class Quantity:
    """A number with a unit, as `-12.5 mm`. Raises ValueError for anything else."""

    __slots__ = ("is_negative", "number", "text", "unit")

    def __init__(self, text: object) -> None:
        match = _QUANTITY.fullmatch(text) if isinstance(text, str) else None
        if match is None:
            raise ValueError('a number with a unit in quotes, as "12.5 mm" or "300 rpm"')
        self.text = match.string
        self.number = abs(Fraction(match[1]))
        self.is_negative = match[1].startswith("-")  # also of -0
        self.unit = _SAME.get(match[2], match[2])


def _range(name: str) -> Meta:
    return Meta(ge=PARAMETERS[name].low, le=PARAMETERS[name].high)


class MotorTable(Struct, kw_only=True, forbid_unknown_fields=True):
    """The motor; `turn_distance` are user units per turn, `lead` is the travel of one turn."""

    microsteps: Annotated[int, _range("microsteps")]
    step_angle: Quantity
    turn_distance: Annotated[int, _range("turn_distance")]
    lead: Quantity | None = None
    stop: Literal["slow", "immediate"] = "slow"
    mode4: Annotated[int, _range("mode4")] = 0
    home_at_power_on: bool = False


class LoopTable(Struct, kw_only=True, forbid_unknown_fields=True):
    """The steps `first` to `last` run `count` times in each pass."""

    first: Annotated[int, _range("step")]
    last: Annotated[int, _range("step")]
    count: Annotated[int, _range("loop_count")]


class StepTable(Struct, kw_only=True, forbid_unknown_fields=True):
    """One step; a negative `move` is in reverse."""

    move: Quantity | None = None
    speed: Quantity | None = None
    start: Quantity | None = None
    acceleration: Quantity | None = None
    output: str = "none"
    delay: Quantity | None = None
    wait_for: int | str = "none"
    stop_on: int | str = "none"


class ProgramFile(Struct, kw_only=True, forbid_unknown_fields=True):
    """A program file, format 1."""

    format: Literal[1]
    name: str = ""
    project: Annotated[int, _range("project")] = 1
    repeat: Annotated[int, Meta(ge=0, le=ENDLESS - 1)] | Literal["endless"] = 1
    expert: bool = False
    motor: MotorTable
    loop: LoopTable | None = None
    inputs: dict[str, Annotated[int, Meta(ge=1, le=INPUTS)]] = {}
    outputs: dict[str, Annotated[int, Meta(ge=1, le=parameters.OUTPUTS)]] = {}
    step: Annotated[list[StepTable], Meta(min_length=1, max_length=STEPS)]


_TABLES: Final = {"motor": MotorTable, "loop": LoopTable, "step": StepTable}
_INPUTS: Final = {"none": 0, **{f"input {number}": number for number in range(1, INPUTS + 1)}}
_OUTPUTS: Final = {text: action for action, text in PARAMETERS["output"].choices.items()}
_WORDS: Final = {*_INPUTS, "all", *(f"output {number}" for number in range(1, parameters.OUTPUTS + 1))}
"""Fixed words of inputs and outputs, which are no names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """A project, its name, and the names of its inputs and outputs; `lead` is mm per turn, if known."""

    project: Project
    name: str = ""
    inputs: Mapping[str, int] = field(default_factory=dict)
    outputs: Mapping[str, int] = field(default_factory=dict)
    lead: Fraction | None = None
    expert: bool = False

    @classmethod
    def parse(cls, source: str) -> Program:
        """From the text of a file. Raises RequestError, naming step and field."""
        file = _decode(source)
        for name in (*file.inputs, *file.outputs):
            if name in _WORDS or name != name.strip() or not name:
                raise _wrong(f"inputs, outputs: {shown(name)} is no name", "a word that is not a fixed one")
        base, lead = _motor(file.motor)
        repeat = ENDLESS if file.repeat == "endless" else file.repeat
        base = replace(base, number=file.project, project_loop=repeat)
        if loop := file.loop:
            base = replace(base, loop_first=loop.first, loop_last=loop.last, loop_count=loop.count)
        steps = tuple(_step(entry, number, file, base, lead) for number, entry in enumerate(file.step, 1))
        return cls(
            project=parameters.with_steps(base, steps), name=file.name, inputs=file.inputs,
            outputs=file.outputs, lead=lead, expert=file.expert,
        )  # fmt: skip

    @classmethod
    def load(cls, path: str) -> Program:
        """From a file. Raises RequestError if it cannot be read, and as `parse`."""
        try:
            with open(path, encoding="utf-8") as file:
                source = file.read()
        except (OSError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", "") or "it is not UTF-8 text"
            raise RequestError(f"{path} cannot be read: {why.lower()}") from error
        return cls.parse(source)

    @classmethod
    def from_dump(cls, data: bytes, *, name: str = "", order: Order = "little") -> Program:
        """From the 226 bytes of the reply to "read project". Raises RequestError for other bytes."""
        head = HEADER + bytes((READ_PROJECT,))
        if len(data) != DUMP_LENGTH or not data.startswith(head):
            raise RequestError(
                "no dump of a project", received=data[:12], expected="226 bytes that begin with FF AA 3E"
            )
        project = parameters.decode_image(data[REPLY_LENGTH:], order)
        return cls(project=replace(project, number=data[3]), name=name)

    def text(self) -> str:
        """The file. Raises RequestError for a project without steps, and for numbers that no file may hold."""
        if self.project.is_cleared:
            raise RequestError(
                f"project {self.project.number} has no steps: it was cleared or its memory was erased",
                advice="write a program to it",
            )
        for error in parameters.check_project(self.project, expert=True):
            raise error
        return "\n".join(_lines(self)) + "\n"

    def lint(self) -> list[Finding]:
        """What in it does not do what it seems to say; see `lint.lint`."""
        return lint(self.project)

    def estimate(self) -> Estimate:
        """How long it takes."""
        return estimate(self.project)


# -- reading ---------------------------------------------------------------------------------------------------------


def _decode(source: str) -> ProgramFile:
    data = read_toml(source)
    try:
        return msgspec.convert(data, ProgramFile, dec_hook=lambda _, text: Quantity(text))
    except msgspec.ValidationError as error:
        message, _, path = str(error).partition(" - at `$")
    keys = re.findall(r"[a-z_0-9]+", path.partition("`")[0])
    words = [f"step {int(keys[1]) + 1}", *keys[2:]] if keys[1:] and keys[0] == "step" else keys
    where = ", ".join(words) or "the file"
    message = message.removeprefix("Object contains ").removeprefix("Expected ")
    if "field" in message:
        table: type[Any] = _TABLES.get("".join(keys[:1]), ProgramFile)
        raise _wrong(f"{where}: {message}", f"one of {', '.join(table.__struct_fields__)}")
    value: Any = data
    for key in keys:
        value = value[int(key) if key.isdigit() else key]
    raise _wrong(f"{where}: {shown(value)} is not possible", message)


def read_toml(source: str) -> dict[str, Any]:
    """The data of a TOML file. Raises RequestError."""
    try:
        return tomllib.loads(source)
    except (ValueError, RecursionError) as error:
        raise _wrong(f"the file is not TOML: {str(error)[:100]}", "a file as in the documentation") from None


def _motor(table: MotorTable) -> tuple[Project, Fraction | None]:
    lead = None
    if table.lead:
        lead = table.lead.number * _LENGTH.get(table.lead.unit, Fraction(0))
        if not lead or table.lead.is_negative:
            raise _wrong(f"motor, lead: {shown(table.lead.text)} is no length", "a length as 5 mm")
    base = Project(
        microsteps=table.microsteps,
        step_angle=_whole(table.step_angle, {"deg": Fraction(100)}, "step_angle", "motor, step_angle"),
        turn_distance=table.turn_distance,
        stop_mode=("slow", "immediate").index(table.stop),
        mode4=table.mode4,
        power_on_home=int(table.home_at_power_on),
    )
    return base, lead


def _step(entry: StepTable, number: int, file: ProgramFile, base: Project, lead: Fraction | None) -> Step:
    where = f"step {number}, "
    turn, pulses = Fraction(base.turn_distance), base.pulses_per_turn or Fraction(1)
    distances = {"units": Fraction(1), "pulses": turn / pulses, "turns": turn, "deg": turn / 360}
    speeds = {"rpm": Fraction(1), "Hz": 60 / pulses, "deg/s": Fraction(1, 6)}
    for unit, size in _LENGTH.items() if lead else ():
        distances[unit] = size * turn / (lead or 1)
        speeds[f"{unit}/s"] = size * 60 / (lead or 1)
    distance = _whole(entry.move, distances, "distance", f"{where}move", is_signed=True)
    if distance and entry.speed is None:
        raise _wrong(f"{where}speed: it is missing, and the step moves", _one_of(speeds))
    return Step(
        distance=distance,
        direction=int(entry.move is not None and entry.move.is_negative),
        speed=_whole(entry.speed, speeds, "speed", f"{where}speed"),
        start_frequency=_whole(entry.start, _HERTZ, "start_frequency", f"{where}start"),
        acceleration=_whole(entry.acceleration, _HERTZ, "acceleration", f"{where}acceleration"),
        delay=_whole(entry.delay, _TIME, "delay", f"{where}delay"),
        output=_output(entry.output, file.outputs, f"{where}output"),
        start_input=_input(entry.wait_for, file, f"{where}wait_for"),
        stop_input=_input(entry.stop_on, file, f"{where}stop_on"),
    )


def _whole(given: Quantity | None, each: _Each, name: str, where: str, *, is_signed: bool = False) -> int:
    """The raw value of a quantity, 0 for None; `each` are raw counts in one of each unit."""
    if given is None:
        return 0
    where = f"{where}: {shown(given.text)}"
    if given.unit not in each:
        raise _wrong(f"{where} has no unit that is possible here", _one_of(each))
    if given.is_negative and not is_signed:
        raise _wrong(f"{where} is negative", _one_of(each))
    raw, row = given.number * each[given.unit], PARAMETERS[name]
    low, high, below, above = (
        f"{float(count / each[given.unit]):.10g}" for count in (row.low, row.high, floor(raw), ceil(raw))
    )
    if not row.low <= raw <= row.high:
        raise _wrong(
            f"{where} is not possible", f"{low} to {high} {given.unit} (raw {row.low} to {row.high})"
        )
    if raw.denominator != 1:
        fault = f"{where} is {float(raw):.12g}, and the controller counts whole numbers"
        raise _wrong(fault, f"{below} or {above} {given.unit}")
    return int(raw)


def _input(given: int | str, file: ProgramFile, where: str) -> int:
    number = given if isinstance(given, int) else (file.inputs | _INPUTS).get(given.strip(), -1)
    try:
        parameters.check_value("start_input", number, expert=file.expert)
    except RequestError as error:
        if number in (3, 4):
            what = f"{where}: {shown(given)} is input {number}, which starts or stops projects"
            raise _wrong(what, f"{error.expected}, or expert = true") from None
        raise _wrong(
            f"{where}: {shown(given)} is not possible", f"{error.expected}, or a name of [inputs]"
        ) from None
    return number


def _output(given: str, names: Mapping[str, int], where: str) -> int:
    words = dict(_OUTPUTS)
    for name, number in names.items():
        words |= {f"{name} {level}": words[f"output {number} {level}"] for level in ("on", "off")}
    action = words.get(given.strip())
    if action is None:
        raise _wrong(f"{where}: {shown(given)} is not possible", f"one of {', '.join(words)}")
    return action


def _one_of(each: _Each) -> str:
    needs_lead = "turns" in each and "mm" not in each
    return f"a number with one of {', '.join(each)}" + "; mm needs a lead" * needs_lead


def _wrong(what: str, expected: str) -> RequestError:
    return RequestError(what, expected=expected, advice="correct the file")


# -- writing ---------------------------------------------------------------------------------------------------------


def _lines(program: Program) -> list[str]:
    project = program.project
    inputs = {step.start_input for step in project.used} | {step.stop_input for step in project.used}
    lines = ["format = 1"]
    lines += _entry("name", program.name)
    lines += [f"project = {project.number}"]
    lines += ['repeat = "endless"' if project.is_endless else f"repeat = {project.project_loop}"]
    lines += ["expert = true"] if program.expert or inputs & {3, 4} else []
    lines += ["", "[motor]", f"microsteps = {project.microsteps}"]
    lines += _entry("step_angle", f"{project.step_angle / 100:.2f} deg")
    lines += [f"turn_distance = {project.turn_distance}"]
    lines += _entry("lead", f"{float(program.lead):.12g} mm" if program.lead else "")
    lines += _entry("stop", "immediate" if project.stop_mode else "")
    lines += [f"mode4 = {project.mode4}"] if project.mode4 else []
    lines += ["home_at_power_on = true"] if project.power_on_home else []
    if project.loop_first:
        lines += ["", "[loop]", f"first = {project.loop_first}", f"last = {project.loop_last}"]
        lines += [f"count = {project.loop_count}"]
    for kind, names in (("inputs", program.inputs), ("outputs", program.outputs)):
        lines += ["", f"[{kind}]"] if names else []
        lines += [f"{_quoted(name)} = {number}" for name, number in names.items()]
    for step in project.used:
        lines += ["", "[[step]]", *_step_lines(step, program)]
    return lines


def _step_lines(step: Step, program: Program) -> list[str]:
    inputs = {0: "", **{number: name for name, number in {**_INPUTS, **program.inputs}.items() if number}}
    output = PARAMETERS["output"].choices[step.output] if step.output else ""
    for name, number in program.outputs.items():
        output = output.replace(f"output {number} ", f"{name} ")
    values = {
        "move": f"{'-' * step.direction}{step.distance} units" if step.distance or step.direction else "",
        "speed": f"{step.speed} rpm" if step.distance or step.speed else "",
        "start": f"{step.start_frequency} Hz" if step.start_frequency else "",
        "acceleration": f"{step.acceleration} Hz" if step.acceleration else "",
        "output": output,
        "delay": f"{step.delay} ms" if step.delay else "",
        "wait_for": inputs[step.start_input],
        "stop_on": inputs[step.stop_input],
    }
    return [line for key, text in values.items() for line in _entry(key, text)]


def _entry(key: str, text: str) -> list[str]:
    """A line of the file; none for an empty text."""
    return [f"{key} = {_quoted(text)}"] if text else []


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in escaped) + '"'
