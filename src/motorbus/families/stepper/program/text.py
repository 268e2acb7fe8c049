"""A project as a file that people write: TOML with units and names, read exactly and written back.

Every key is known; one that is not is refused, for a word misspelt is a value that silently has its default. Errors
name the step and the field, say what was found and what may be.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from difflib import get_close_matches
from fractions import Fraction
from typing import Any, Final, NamedTuple

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.families.stepper.program import names, quantities
from motorbus.families.stepper.program.quantities import Geometry, refuse
from motorbus.families.stepper.program.source import FORMAT, check_format, toml
from motorbus.families.stepper.program.words import HELD, range_of, within
from motorbus.families.stepper.table import (
    BASE_NAMES,
    ENDLESS,
    STEP_NAMES,
    STEPS,
    Project,
    Step,
    is_allowed,
    with_steps,
)

"""Characters a file may have; ten steps never need more."""
TOP: Final = (
    "format", "name", "project", "repeat", "total_steps", "expert", "motor", "loop", "inputs", "outputs", "step",
)  # fmt: skip
MOTOR: Final = (
    "microsteps", "step_angle", "full_steps", "turn_distance", "unit", "lead", "stop", "mode4", "home_at_power_on",
)  # fmt: skip
LOOP: Final = ("first", "last", "count")
STEP: Final = ("move", "speed", "start", "acceleration", "delay", "output", "wait_for", "stop_on")
STOPS: Final = ("slow", "immediate")


class Source(NamedTuple):
    """What a file says beyond the numbers of its project: its name, names of inputs and outputs, mm for a turn.

    `motor` says in words what the controller is told of it where that is not what the file says; else it is "".
    """

    project: Project
    name: str = ""
    inputs: Mapping[str, int] = {}
    outputs: Mapping[str, int] = {}
    lead: Fraction | None = None
    expert: bool = False
    motor: str = ""


def parse(text: str) -> Source:
    """The project that a file describes. Raises RequestError, naming step and field, for what cannot be."""
    data = toml(text, "TOML, as in the example of the documentation")
    check_format(data)
    _known(data, TOP, "the file")
    expert = _boolean(data, "expert", "expert")
    inputs, outputs = (names.named(data.get(f"{kind}s", {}), kind) for kind in ("input", "output"))
    base, lead, motor = _motor(_table(data, "motor"), expert)
    first, last, count = _loop(_table(data, "loop"))
    base = replace(
        base, number=_integer(data, "project", "project", 1), project_loop=_repeat(data.get("repeat", 1))
    )
    base = replace(base, loop_first=first, loop_last=last, loop_count=count)
    _refuse(base, expert, steps=False)
    steps = _steps(data, Reader(Geometry.of(base, lead), inputs, outputs, expert))
    made = with_steps(base, steps)
    made = replace(made, total_steps=_integer(data, "total_steps", "total_steps", len(steps)))
    if made.total_steps > len(steps):
        raise refuse(
            f"total_steps: {shown(made.total_steps)}, but the file has {len(steps)} steps",
            f"1 to {len(steps)}",
        )
    _refuse(replace(made, total_steps=len(steps)), expert)
    _refuse(made, expert)
    if not expert and not _loop_is_range(made):
        raise refuse(
            f"[loop]: {first} to {last} is no range of the {made.total_steps} steps",
            f"1 <= first <= last <= {made.total_steps}",
        )
    name = data.get("name", "")
    if not isinstance(name, str):
        raise refuse(f"name: {shown(name)} is no text", "text in quotes")
    return Source(made, name, inputs, outputs, lead, expert, motor)


def write(source: Source) -> str:
    """The file for a project: what `parse` makes the same project of, with `expert = true` where only that takes it.

    Raises RequestError for a project that no file may say, as one with an output action of 9.
    """
    project, expert = source.project, source.expert or _needs_expert(source.project)
    if project.is_cleared:
        raise _unsaid(project)
    steps = _filled(project)
    _refuse(project, expert)
    _refuse(replace(project, total_steps=steps), expert)
    lines = [f"format = {FORMAT}"]
    lines += [f"name = {_quoted(source.name)}"] if source.name else []
    lines += [f"project = {project.number}"]
    lines += ['repeat = "endless"' if project.is_endless else f"repeat = {project.project_loop}"]
    lines += [f"total_steps = {project.total_steps}"] if steps > project.total_steps else []
    lines += ["expert = true"] if expert else []
    lines += ["", "[motor]", *_motor_lines(source)]
    if project.loop_first or project.loop_last or project.loop_count:
        values = project.loop_first, project.loop_last, project.loop_count
        lines += ["", "[loop]", *(f"{key} = {value}" for key, value in zip(LOOP, values, strict=True))]
    for kind, table in (("inputs", source.inputs), ("outputs", source.outputs)):
        lines += (
            ["", f"[{kind}]", *(f"{_quoted(name)} = {number}" for name, number in table.items())]
            if table
            else []
        )
    for number in range(1, steps + 1):
        lines += ["", "[[step]]", *_step_lines(project.step(number), source)]
    return "\n".join(lines) + "\n"


# --- reading --------------------------------------------------------------------------------------------------------


def _known(table: Mapping[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in keys:
            near = get_close_matches(key, keys, n=1)
            hint = f"perhaps {near[0]}; " if near else ""
            raise refuse(f"{where}: there is no field {shown(key)}", f"{hint}one of {', '.join(keys)}")


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    table = data.get(key, {})
    if not isinstance(table, Mapping):
        raise refuse(f"{key}: {shown(table)} is no table", f"a table [{key}]")
    return table


def _integer(table: Mapping[str, Any], key: str, where: str, usual: int) -> int:
    value = table.get(key, usual)
    if type(value) is not int:
        raise refuse(f"{where}: {shown(value)} is no whole number", "a whole number without a unit")
    return value


def _boolean(table: Mapping[str, Any], key: str, where: str) -> bool:
    value = table.get(key, False)
    if not isinstance(value, bool):
        raise refuse(f"{where}: {shown(value)} is neither true nor false", "true or false")
    return value


def _motor(table: Mapping[str, Any], expert: bool) -> tuple[Project, Fraction | None, str]:
    _known(table, MOTOR, "[motor]")
    angle, microsteps, told = _geometry(table, expert)
    lead = quantities.millimetres(table["lead"], "lead") if "lead" in table else None
    stop = table.get("stop", STOPS[0])
    if stop not in STOPS:
        raise refuse(f"stop: {shown(stop)} is no stop mode", " or ".join(STOPS))
    base = Project(
        microsteps=microsteps,
        step_angle=angle,
        stop_mode=STOPS.index(stop),
        mode4=_integer(table, "mode4", "mode4", 0),
        power_on_home=int(_boolean(table, "home_at_power_on", "home_at_power_on")),
    )
    return replace(base, turn_distance=_turn_distance(table, base, lead)), lead, told


def _geometry(table: Mapping[str, Any], expert: bool) -> tuple[int, int, str]:
    """Step angle (hundredths of a degree), microsteps, and in words what is told where the file says it otherwise."""
    if "microsteps" not in table:
        raise refuse("microsteps: they are missing in [motor]", range_of("microsteps"))
    microsteps = _integer(table, "microsteps", "microsteps", 0)
    within("microsteps", microsteps, expert=expert)
    if ("step_angle" in table) == ("full_steps" in table):
        raise refuse(
            "step_angle: [motor] needs step_angle or full_steps, one of them", 'step_angle = "1.8 deg"'
        )
    if "step_angle" in table:
        return quantities.hundredths(table["step_angle"], "step_angle", expert=expert), microsteps, ""
    full = _integer(table, "full_steps", "full_steps", 0)
    angle, found = quantities.motor_of(full, microsteps, "full_steps")
    if found == microsteps:
        return angle, found, ""
    meant = f"{full} full steps of {microsteps} microsteps are stored as {angle / 100:g} deg and {found} microsteps"
    return angle, found, f"{meant}: {full * microsteps} pulses a turn either way"


def _turn_distance(table: Mapping[str, Any], base: Project, lead: Fraction | None) -> int:
    if ("turn_distance" in table) == ("unit" in table):
        raise refuse(
            "turn_distance: [motor] needs turn_distance or unit, one of them", 'unit = "pulse", or 0.001 mm'
        )
    if "turn_distance" in table:
        return _integer(table, "turn_distance", "turn_distance", 0)
    said = str(table["unit"]).strip()
    text = f"1 {said}" if said in ("pulse", "turn") else table["unit"]
    known = "pulse, turn, 0.01 deg" + (", 0.001 mm" if lead else "")
    unit = quantities.amount(text, "unit", known)
    turn = Geometry(base.pulses_per_turn or Fraction(0), 0, lead)  # of the units in it nothing is known yet
    turns = turn.turns(unit.unit)
    if turns is None or unit.number <= 0:
        why = quantities.NEEDS_LEAD if unit.unit in quantities.LENGTH and not lead else ""
        raise refuse(f"unit: {shown(table['unit'])} is no unit of distance here", known, why)
    each = 1 / (unit.number * turns)
    return quantities.whole(
        each,
        "unit",
        table["unit"],
        "units per turn",
        "turn_distance",
        lambda count: f"{count} units per turn",
    )


def _loop(table: Mapping[str, Any]) -> tuple[int, int, int]:
    _known(table, LOOP, "[loop]")
    if table and set(table) != set(LOOP):
        raise refuse("[loop]: it needs first, last and count", "first = 2, last = 3, count = 2")
    first, last, count = (_integer(table, key, f"[loop], {key}", 0) for key in LOOP)
    return first, last, count


def _repeat(said: object) -> int:
    if said == "endless":
        return ENDLESS
    if type(said) is not int or not 0 <= said < ENDLESS:
        raise refuse(f"repeat: {shown(said)} is not possible", f'0 to {ENDLESS - 1}, or "endless"')
    return said


class Reader(NamedTuple):
    """What the rest of a file means for its steps."""

    geometry: Geometry
    inputs: Mapping[str, int]
    outputs: Mapping[str, int]
    expert: bool


def _steps(data: Mapping[str, Any], known: Reader) -> tuple[Step, ...]:
    rows = data.get("step", [])
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise refuse("step: it is no list of steps", "tables [[step]]")
    if not 1 <= len(rows) <= STEPS:
        raise refuse(f"step: the file has {len(rows)} steps", f"1 to {STEPS}")
    return tuple(_step(row, f"step {number}", known) for number, row in enumerate(rows, start=1))


def _step(row: Mapping[str, Any], where: str, known: Reader) -> Step:
    _known(row, STEP, where)
    geometry, inputs, outputs, expert = known
    distance, reverse = quantities.distance(row.get("move", "0 units"), f"{where}, move", geometry)
    if distance and "speed" not in row:
        raise refuse(f"{where}, speed: it is missing, and the step moves", "a speed such as 60 rpm")
    return Step(
        distance=distance,
        direction=int(reverse),
        speed=quantities.speed(row.get("speed", "0 rpm"), f"{where}, speed", geometry),
        start_frequency=quantities.hertz(row.get("start", "0 Hz"), f"{where}, start"),
        acceleration=quantities.hertz(
            row.get("acceleration", "0 Hz"), f"{where}, acceleration", "acceleration"
        ),
        delay=quantities.milliseconds(row.get("delay", "0 ms"), f"{where}, delay"),
        output=names.output_of(row.get("output", "none"), f"{where}, output", outputs),
        start_input=names.input_of(row.get("wait_for", "none"), f"{where}, wait_for", inputs, expert=expert),
        stop_input=names.input_of(row.get("stop_on", "none"), f"{where}, stop_on", inputs, expert=expert),
    )


def _refuse(project: Project, expert: bool, *, steps: bool = True) -> None:
    within("project", project.number)
    for name in BASE_NAMES:
        if steps or name != "total_steps":
            within(name, getattr(project, name), expert=expert)
    for number in range(1, min(project.total_steps, STEPS) + 1 if steps else 1):
        for name in STEP_NAMES:
            within(name, getattr(project.step(number), name), number, expert=expert)


def _loop_is_range(project: Project) -> bool:
    first, last = project.loop_first, project.loop_last
    return 1 <= first <= last <= project.total_steps or not (first or last)


# --- writing --------------------------------------------------------------------------------------------------------


def _needs_expert(project: Project) -> bool:
    used = {number for step in project.steps for number in (step.start_input, step.stop_input)}
    held = any(not is_allowed(name, getattr(project, name)) for name in HELD)
    return bool(used & {3, 4}) or held or not _loop_is_range(project)


def _unsaid(project: Project) -> RequestError:
    """The error for a project without steps, with whatever was written into it since it was cleared."""
    number, blank = project.number, Project()
    since = [name for name in BASE_NAMES if name != "number" and getattr(project, name)]
    since += [f"step {n}" for n in range(1, STEPS + 1) if project.step(n) != blank.step(n)]
    told = f"; {', '.join(since)} were written since" if since else ""
    return RequestError(
        f"project {number} has been cleared: there is nothing for a file to say{told}",
        expected="at least one step",
        cause="only selecting it again, which says how many steps it has, gives it steps" if since else "",
        advice="keep it as a dump; nothing was sent" if since else "nothing was sent",
    )


def _filled(project: Project) -> int:
    """How many rows a file needs: those that are carried out, and those behind them that hold something."""
    filled = [number for number in range(1, STEPS + 1) if project.step(number) != Step()]
    return max([min(project.total_steps, STEPS), *filled])


def _motor_lines(source: Source) -> Iterator[str]:
    project = source.project
    yield f"microsteps = {project.microsteps}"
    yield f'step_angle = "{project.step_angle // 100}.{project.step_angle % 100:02} deg"'
    yield f"turn_distance = {project.turn_distance}"
    if source.lead is not None:
        yield f'lead = "{_decimal(source.lead)} mm"'
    yield f'stop = "{STOPS[project.stop_mode]}"'
    if project.mode4:
        yield f"mode4 = {project.mode4}"
    if project.power_on_home:
        yield "home_at_power_on = true"


def _step_lines(step: Step, source: Source) -> Iterator[str]:
    if step.distance or step.direction:
        yield f'move = "{"-" if step.direction else ""}{step.distance} units"'
    if step.distance or step.speed:
        yield f'speed = "{step.speed} rpm"'
    if step.start_frequency:
        yield f'start = "{step.start_frequency} Hz"'
    if step.acceleration:
        yield f'acceleration = "{step.acceleration} Hz"'
    if step.delay:
        yield f'delay = "{step.delay} ms"'
    if step.output:
        yield f"output = {_quoted(names.output_name(step.output, source.outputs))}"
    if step.start_input:
        yield f"wait_for = {_quoted(names.input_name(step.start_input, source.inputs))}"
    if step.stop_input:
        yield f"stop_on = {_quoted(names.input_name(step.stop_input, source.inputs))}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in escaped) + '"'


def _decimal(number: Fraction) -> str:
    """A fraction that came from a decimal number, as one; every lead of a file is of that kind."""
    places = 0
    while (number * 10**places).denominator != 1 and places < 40:
        places += 1
    digits = f"{int(number * 10**places):0{places + 1}}"
    return f"{digits[:-places]}.{digits[-places:]}" if places else digits
