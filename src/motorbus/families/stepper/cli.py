"""The commands `motorbus stepper …`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import pi, tau
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import App, Parameter
from msgspec import Struct

from motorbus.cli.common import Common, Exit, Target, Writing
from motorbus.cli.dryrun import carry_out
from motorbus.cli.output import confirm, emit, note, progress
from motorbus.cli.target import open_devices, parse_quantity
from motorbus.core import units
from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, MotorbusError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.stepper.driver.controller import Controller
from motorbus.families.stepper.driver.io import InputChanged
from motorbus.families.stepper.driver.run import Outcome, Ran
from motorbus.families.stepper.execution import ramp
from motorbus.families.stepper.parameters import PARAMETERS, Project
from motorbus.families.stepper.program import estimate
from motorbus.families.stepper.program.file import Program
from motorbus.families.stepper.program.lint import Finding

app = App(name="stepper", help="Commands of stepper controllers only.", help_epilogue="")

LEVELS: Final = {"on": True, "off": False}
PORTS: Final = {"1": 1, "2": 2, "3": 3, "all": 4, "leds": 5}
ERRORS: Final[dict[Outcome, type[MotorbusError]]] = {
    Outcome.STOPPED: Interrupted,
    Outcome.TIMEOUT: NoReply,
    Outcome.UNKNOWN: OutcomeUnknown,
}
FAR: Final = pi  # rad; a longer way needs consent
Number = Annotated[int | None, Parameter(help="Project 1 to 4.")]


class StepPlan(Struct, frozen=True):
    """A step: how often, its movement, the time of the motion and of the pause, its inputs and output."""

    step: int
    times: int
    units: int
    pulses: int
    frequency: float
    motion: float
    pause: float
    output: str
    wait: int | None
    stop: int | None


class Checked(Struct, frozen=True, tag="checked"):
    """The estimated time of a program, its steps, and its findings."""

    estimate: str
    steps: list[StepPlan]
    findings: list[Finding]


class Difference(Struct, frozen=True):
    """A parameter of a project: in the controller, in the file."""

    parameter: str
    now: Any
    new: Any


class Result(Struct, frozen=True, tag="project"):
    """What was done with a project."""

    project: int
    outcome: str
    detail: str = ""
    seconds: float | None = None


class Ports(Struct, frozen=True, tag="ports"):
    """Inputs as read, or outputs as last commanded: True is active, None unknown."""

    inputs: dict[str, bool | None] = {}
    outputs: dict[str, bool | None] = {}


def _controller(devices: list[Target]) -> Target:
    """The only device, a stepper controller. Raises RequestError."""
    if len(devices) != 1 or not isinstance(devices[0].device, Controller):
        names = ", ".join(f"{one.family.name} {one.name}" for one in devices)
        raise RequestError(f"{names}: one stepper controller is needed", expected="as stepper:/dev/ttyUSB0")
    return devices[0]


# -- programs ------------------------------------------------------------------------------------------------------


@app.command
def check(file: Path, /, *, common: Common = Common()) -> int:
    """Show steps, duration and mistakes of a program file; opens no port.

    Examples:

        motorbus stepper check examples/pick_and_place.toml
        motorbus stepper check feed.toml
        motorbus stepper check feed.toml --json

    Exit code 1 if a finding is an error.
    """
    program = Program.load(str(file))
    steps = [_step(program.project, number) for number in range(1, program.project.total_steps + 1)]
    found = program.lint()
    emit(Checked(str(program.estimate()), steps, found), common)
    return Exit.FAILURE if any(one.level == "error" for one in found) else Exit.OK


def _step(project: Project, number: int) -> StepPlan:
    step = project.step(number)
    return StepPlan(
        step=number,
        times=project.times(number),
        units=step.sign * step.distance,
        pulses=ramp.pulses_of(project, step),
        frequency=ramp.ramp_of(project, step).run,
        motion=ramp.move_of(project, step).duration,
        pause=step.delay / 1000,
        output=PARAMETERS["output"].choices[step.output] if step.output else "",
        wait=step.start_input or None,
        stop=step.stop_input or None,
    )


@app.command
def write(
    file: Path,
    device: str,
    /,
    *,
    project: Number = None,
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Write a program into a project, save it and read it back; only what differs is sent.

    Examples:

        motorbus stepper write feed.toml stepper:/dev/ttyUSB0 --project 3
        motorbus stepper write examples/pick_and_place.toml stepper:sim --dry-run
        motorbus stepper write feed.toml lift --yes

    --dry-run shows what differs.
    """
    program = Program.load(str(file))
    number = project or program.project.number
    with open_devices(common, (device,)) as devices:
        target = _controller(devices)
        changes = target.device.difference(program, number)
        rows = [Difference(name, old, new) for name, (old, new) in changes.items()]
        for finding in program.lint():
            note(str(finding))
        if rows and (writing.dry_run or not (writing.yes or common.json)):
            emit(rows, common)
        if writing.dry_run:
            if not rows:
                emit(Result(number, "unchanged", "nothing differs"), common)
            return
        if rows:
            confirm(f"write {len(rows)} parameters to project {number} of {target.name}", writing)
        written = target.device.write_project(program, number)
        emit(Result(number, written.proof, f"parameters changed: {len(written.changes)}"), common)


@app.command
def read(
    device: str,
    /,
    *,
    project: Number = 1,
    to: Annotated[Path | None, Parameter(help="New file; without it the text is printed.")] = None,
    common: Common = Common(),
) -> None:
    """Read a project as a program file.

    Examples:

        motorbus stepper read stepper:/dev/ttyUSB0 --project 2 --to feed.toml
        motorbus stepper read stepper:/dev/ttyUSB0 > feed.toml
        motorbus stepper read lift --json
    """
    with open_devices(common, (device,)) as devices:
        target = _controller(devices)
        number = project or 1
        text = target.device.read_project(number).text()
    if to is not None:
        try:
            with to.open("x", encoding="utf-8") as stream:
                stream.write(text)
        except FileExistsError:
            raise RequestError(f"{to} exists", expected="the name of a new file") from None
        emit(Result(number, "read", str(to)), common)
    elif common.json:
        emit(Result(number, "read", text), common)
    else:
        print(text, end="")


# -- run -----------------------------------------------------------------------------------------------------------


@app.command
def run(
    device: str,
    project: Annotated[int, Parameter(name="N")],
    /,
    *,
    timeout: Annotated[str, Parameter(help="Longest wait, as 90s.")] = "",
    writing: Writing = Writing(),
    common: Common = Common(),
) -> None:
    """Start project N and wait for its end.

    Examples:

        motorbus stepper run stepper:/dev/ttyUSB0 2
        motorbus stepper run stepper:sim 1 --yes
        motorbus stepper run lift 2 --timeout 90s

    Without --timeout: 1.2 times the estimate and 2 s; no limit with inputs.
    Exit code 0: its notice came; 5: not in time; 10: stopped. Ctrl-C stops nothing.
    """
    seconds = parse_quantity(timeout, "time") if timeout else None
    endless = seconds is not None
    with open_devices(common, (device,)) as devices:
        target = _controller(devices)
        if writing.dry_run:
            carry_out(writing, target, lambda one: one.start_project(project, endless=endless))
            return
        if way := _way(target.device.read_project(project)):
            confirm(f"start project {project} of {target.name}, {way}", writing)
        procedure = Controller.run.function(target.device, project, timeout=seconds, endless=endless)
        try:
            with progress(f"project {project}") as advance:
                ran: Ran = target.bus.run(procedure, report=partial(_report, advance))
        except (KeyboardInterrupt, SystemExit):
            note(f"project {project} may still run: `motorbus stop {device}` ends it")
            raise
        except Interrupted:  # an emergency stop; one more that is acknowledged ends the run in the journal
            target.device.stop()
            raise Interrupted(f"project {project}: stopped by an emergency stop") from None
    emit(Result(project, ran.outcome.value, f"{ran.why}; estimate: {ran.predicted}", ran.seconds), common)
    if error := ERRORS.get(ran.outcome):
        advice = (
            "" if ran.outcome is Outcome.STOPPED else f"`motorbus stop {device}` ends it if it still runs"
        )
        raise error(f"project {project}: {ran.outcome.value}: {ran.why}", advice=advice)


def _way(program: Program) -> str:
    """Why a start needs consent; "" if it needs none."""
    project = program.project
    if project.is_endless:
        return "which has no end"
    angle = max(map(abs, estimate.reach(project))) * tau / (project.turn_distance or 1)
    return f"which turns by up to {units.show(angle, 'position')}" if angle > FAR else ""


def _report(advance: Callable[..., None], event: object) -> None:
    if isinstance(event, InputChanged):
        note(f"input {event.port} is {'active' if event.active else 'inactive'}")
    elif isinstance(event, Progress):
        advance(event.done, event.total, event.what)


# -- inputs and outputs --------------------------------------------------------------------------------------------


@app.command
def io(
    device: str,
    /,
    *levels: Annotated[str, Parameter(name="OUT=LEVEL")],
    watch: Annotated[str, Parameter(help="Watch the inputs for this time, as 10s.")] = "",
    common: Common = Common(),
) -> None:
    """Read the inputs, or set outputs: 1, 2, 3, all or leds, on or off.

    Examples:

        motorbus stepper io stepper:/dev/ttyUSB0
        motorbus stepper io stepper:sim 1=on leds=off
        motorbus stepper io lift --watch 10s

    What is connected to an output may move. Outputs cannot be read.
    """
    wanted = [_level(text) for text in levels]
    seconds = parse_quantity(watch, "time") if watch else 0.0
    with open_devices(common, (device,)) as devices:
        target = _controller(devices)
        one: Any = target.device
        for port, active in wanted:
            one.set_output(port, active)
        if wanted:
            emit(Ports(outputs={str(port): level for port, level in one.last_commanded.items()}), common)
            return
        if watch:
            procedure = Controller.watch_inputs.function(one, seconds=seconds)
            with progress("inputs") as advance:
                target.bus.run(procedure, report=partial(_report, advance))
        emit(Ports(inputs={str(port): active for port, active in one.inputs().items()}), common)


def _level(text: str) -> tuple[int, bool]:
    port, _, level = text.partition("=")
    if port not in PORTS or level not in LEVELS:
        raise RequestError(f"{text!r} is not OUT=LEVEL", expected="1, 2, 3, all or leds, = on or off")
    return PORTS[port], LEVELS[level]
