"""A project as a TOML file with units and names; its schema is that of `ProgramFile`.

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

LONGEST: Final = 1 << 20  # characters of a file
FORMAT: Final = 1

_QUANTITY: Final = re.compile(
    r"([+-]?(?:\d{1,20}(?:\.\d{0,20})?|\.\d{1,20}))\s*([^\d\s.].*)", re.ASCII | re.DOTALL
)
_SAME: Final = {
    "unit": "units",
    "pulse": "pulses",
    "turn": "turns",
    "°": "deg",
    "RPM": "rpm",
    "µm": "um",
    "μm": "um",
}
_LENGTH: Final = {"mm": Fraction(1), "um": Fraction(1, 1000), "cm": Fraction(10), "m": Fraction(1000)}
_TIME: Final = {"ms": Fraction(1), "s": Fraction(1000), "min": Fraction(60_000), "h": Fraction(3_600_000)}
_HERTZ: Final = {"Hz": Fraction(1), "kHz": Fraction(1000)}
_Each = Mapping[str, Fraction]


class Quantity:
    """A number with a unit, as `-12.5 mm`. Raises ValueError for anything else."""

    __slots__ = ("number", "text", "unit")

    def __init__(self, text: object) -> None:
        match = _QUANTITY.fullmatch(text.strip()) if isinstance(text, str) else None
        if match is None or not isinstance(text, str):
            raise ValueError("expected a number with a unit in quotes")
        self.text = text
        self.number = Fraction(match[1])
        self.unit = _SAME.get(match[2], match[2])

    @property
    def is_negative(self) -> bool:
        """Also for -0."""
        return self.text.strip().startswith("-")


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


_TABLES: Final = {"": ProgramFile, "motor": MotorTable, "loop": LoopTable, "step": StepTable}


def schema() -> dict[str, Any]:
    """The JSON schema of a program file."""
    return msgspec.json.schema(
        ProgramFile, schema_hook=lambda _: {"type": "string", "description": "number and unit"}
    )


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
        return cls.parse(read_text(path))

    @classmethod
    def from_dump(cls, data: bytes, *, name: str = "", order: Order = "little") -> Program:
        """From the 226 bytes of the reply to "read project". Raises RequestError for other bytes."""
        head = HEADER + bytes((READ_PROJECT,))
        if len(data) != DUMP_LENGTH or not data.startswith(head):
            raise RequestError(
                "no dump of a project", received=data[:12], expected="226 bytes that begin with FF AA 3E"
            )
        return cls(
            project=replace(parameters.decode_image(data[REPLY_LENGTH:], order), number=data[3]), name=name
        )

    def text(self) -> str:
        """The file. Raises RequestError for numbers that no file may hold, as those of a cleared project."""
        for error in parameters.check_project(self.project, expert=True):
            raise error
        return "\n".join(_lines(self)) + "\n"

    def lint(self, **conditions: Any) -> list[Finding]:
        """What in it does not do what it seems to say; see `lint.lint`."""
        return lint(self.project, **conditions)

    def estimate(self) -> Estimate:
        """How long it takes."""
        return estimate(self.project)


def read_text(path: str) -> str:
    """The text of a file. Raises RequestError if it cannot be read."""
    try:
        with open(path, encoding="utf-8") as file:
            return file.read(LONGEST + 1)
    except UnicodeDecodeError as error:
        raise RequestError(f"{path} is not text: {error.reason}", expected="TOML in UTF-8") from None
    except OSError as error:
        raise RequestError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}") from error


# -- reading ---------------------------------------------------------------------------------------------------------


def _decode(source: str) -> ProgramFile:
    data = read_toml(source)
    try:
        return msgspec.convert(data, ProgramFile, dec_hook=lambda _, text: Quantity(text))
    except msgspec.ValidationError as error:
        message, _, path = str(error).partition(" - at `$")
    keys = re.findall(r"[a-z_0-9]+", path.partition("`")[0])
    value: Any = data
    for key in keys:
        value = value[int(key) if key.isdigit() else key]
    words = [f"step {int(keys[1]) + 1}", *keys[2:]] if keys[1:] and keys[0] == "step" else keys
    where = ", ".join(words) or "the file"
    if "field" in message:
        table = _TABLES.get("".join(keys[:1]), ProgramFile)
        raise _wrong(f"{where}: {message}", f"one of {', '.join(table.__struct_fields__)}")
    raise _wrong(f"{where}: {shown(value)} is not possible", message)


def read_toml(source: str) -> dict[str, Any]:
    """The data of a TOML file of at most 1 MiB. Raises RequestError."""
    if len(source) > LONGEST:
        raise _wrong("the file is too long", f"at most {LONGEST} characters")
    try:
        return tomllib.loads(source)
    except (ValueError, RecursionError) as error:
        raise _wrong(f"the file is not TOML: {str(error)[:100]}", "a file as in the documentation") from None


def _motor(table: MotorTable) -> tuple[Project, Fraction | None]:
    lead = None
    if table.lead:
        lead = table.lead.number * _LENGTH.get(table.lead.unit, Fraction(0))
        if lead <= 0:
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


def _distances(project: Project, lead: Fraction | None) -> dict[str, Fraction]:
    """User units in one of each unit of distance."""
    turn, pulses = Fraction(project.turn_distance), project.pulses_per_turn or Fraction(1)
    each = {"units": Fraction(1), "pulses": turn / pulses, "turns": turn, "deg": turn / 360}
    return each | ({unit: size * turn / lead for unit, size in _LENGTH.items()} if lead else {})


def _speeds(project: Project, lead: Fraction | None) -> dict[str, Fraction]:
    """RPM in one of each unit of speed."""
    each = {"rpm": Fraction(1), "Hz": 60 / (project.pulses_per_turn or Fraction(1)), "deg/s": Fraction(1, 6)}
    return each | ({f"{unit}/s": size * 60 / lead for unit, size in _LENGTH.items()} if lead else {})


def _step(entry: StepTable, number: int, file: ProgramFile, base: Project, lead: Fraction | None) -> Step:
    where = f"step {number}, "
    distances, speeds = _distances(base, lead), _speeds(base, lead)
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


def _whole(said: Quantity | None, each: _Each, name: str, where: str, *, is_signed: bool = False) -> int:
    """The raw value of a quantity, 0 for None; `each` are raw counts in one of each unit."""
    if said is None:
        return 0
    where = f"{where}: {shown(said.text)}"
    if said.unit not in each:
        raise _wrong(f"{where} has no unit that is possible here", _one_of(each))
    if said.is_negative and not is_signed:
        raise _wrong(f"{where} is negative", _one_of(each))
    raw, row = abs(said.number) * each[said.unit], PARAMETERS[name]
    low, high, below, above = (
        f"{float(count / each[said.unit]):.10g}" for count in (row.low, row.high, floor(raw), ceil(raw))
    )
    if not row.low <= raw <= row.high:
        raise _wrong(f"{where} is not possible", f"{low} to {high} {said.unit} (raw {row.low} to {row.high})")
    if raw.denominator != 1:
        fault = f"{where} is {float(raw):.12g}, and the controller counts whole numbers"
        raise _wrong(fault, f"{below} or {above} {said.unit}")
    return int(raw)


def _input(said: int | str, file: ProgramFile, where: str) -> int:
    words = file.inputs | {"none": 0} | {f"input {number}": number for number in range(1, INPUTS + 1)}
    number = said if isinstance(said, int) else words.get(said.strip(), -1)
    try:
        parameters.check_value("start_input", number, expert=file.expert)
    except RequestError as error:
        hint = "; 3 and 4 with expert = true" if number in (3, 4) else ""
        raise _wrong(
            f"{where}: {shown(said)} is not possible", f"{error.expected}{hint}, or a name of [inputs]"
        ) from None
    return number


def _output(said: str, names: Mapping[str, int], where: str) -> int:
    words = {text: action for action, text in PARAMETERS["output"].choices.items()}
    for name, number in names.items():
        for level in ("on", "off"):
            words.setdefault(f"{name} {level}", words[f"output {number} {level}"])
    action = words.get(said.strip())
    if action is None:
        raise _wrong(f"{where}: {shown(said)} is not possible", f"one of {', '.join(words)}")
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
    lines = [f"format = {FORMAT}"]
    lines += [f"name = {_quoted(program.name)}"] if program.name else []
    lines += [f"project = {project.number}"]
    lines += ['repeat = "endless"' if project.is_endless else f"repeat = {project.project_loop}"]
    lines += ["expert = true"] if program.expert or inputs & {3, 4} else []
    lines += ["", "[motor]", f"microsteps = {project.microsteps}"]
    lines += [
        f'step_angle = "{project.step_angle / 100:.2f} deg"',
        f"turn_distance = {project.turn_distance}",
    ]
    lines += [f'lead = "{float(program.lead):.12g} mm"'] if program.lead else []
    lines += ['stop = "immediate"'] if project.stop_mode else []
    lines += [f"mode4 = {project.mode4}"] if project.mode4 else []
    lines += ["home_at_power_on = true"] if project.power_on_home else []
    if project.loop_first:
        lines += ["", "[loop]", f"first = {project.loop_first}", f"last = {project.loop_last}"]
        lines += [f"count = {project.loop_count}"]
    for kind, names in (("inputs", program.inputs), ("outputs", program.outputs)):
        lines += (
            ["", f"[{kind}]", *(f"{_quoted(name)} = {number}" for name, number in names.items())]
            if names
            else []
        )
    for step in project.used:
        lines += ["", "[[step]]", *_step_lines(step, program)]
    return lines


def _step_lines(step: Step, program: Program) -> list[str]:
    inputs = {number: name for name, number in program.inputs.items()}
    output = PARAMETERS["output"].choices[step.output]
    for name, number in program.outputs.items():
        output = output.replace(f"output {number} ", f"{name} ")
    values = {
        "move": f"{'-' * step.direction}{step.distance} units" if step.distance or step.direction else "",
        "speed": f"{step.speed} rpm" if step.distance or step.speed else "",
        "start": f"{step.start_frequency} Hz" if step.start_frequency else "",
        "acceleration": f"{step.acceleration} Hz" if step.acceleration else "",
        "output": output if step.output else "",
        "delay": f"{step.delay} ms" if step.delay else "",
        "wait_for": inputs.get(step.start_input, f"input {step.start_input}") if step.start_input else "",
        "stop_on": inputs.get(step.stop_input, f"input {step.stop_input}") if step.stop_input else "",
    }
    return [f"{key} = {_quoted(text)}" for key, text in values.items() if text]


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in escaped) + '"'
