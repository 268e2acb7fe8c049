"""The commands `motorbus stepper ...`, and the functions that common commands use of this family.

`motorbus.cli.faces` finds the functions by their names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import tau
from typing import Annotated, Any, Final

from cyclopts import App, Group, Parameter

from motorbus.cli import consent, dry, target
from motorbus.cli.device_command import DeviceCommand, device_command, family_command
from motorbus.cli.exits import Exit
from motorbus.cli.output import Bar, Output
from motorbus.cli.parameters import Silent
from motorbus.core import units
from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, MotorbusError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.stepper.driver.controller import Controller
from motorbus.families.stepper.driver.io import InputChanged
from motorbus.families.stepper.driver.projects import Written
from motorbus.families.stepper.driver.run import Outcome, Ran
from motorbus.families.stepper.edits import edited
from motorbus.families.stepper.execution import ramp, sequence
from motorbus.families.stepper.parameters import BLANK, PARAMETERS, PROJECTS, decode_image, encode_image
from motorbus.families.stepper.program import estimate
from motorbus.families.stepper.program.backup import KIND, Backup
from motorbus.families.stepper.program.file import Program, read_text, read_toml
from motorbus.families.stepper.protocol import REPLY_LENGTH, decode_request, encode, encode_reply

Device = Annotated[str, Parameter(name="BUS", help="As stepper:/dev/ttyUSB0.")]
File = Annotated[str, Parameter(name="FILE", help="A program, or a backup of all projects.")]
Number = Annotated[int | None, Parameter(help="Project 1 to 4.")]
Expert = Annotated[bool, Parameter(negative="", help="Allow errors of `check`.")]
Endless = Annotated[bool, Parameter(negative="", help="Allow a project without end; needs --timeout.")]
Run = DeviceCommand[Controller]
LEVELS: Final = {"on": True, "off": False}
WORDS: Final = {True: "active", False: "inactive", None: "unknown"}
PORTS: Final = {"1": 1, "2": 2, "3": 3, "all": 4, "leds": 5}
COLUMNS: Final = ("step", "times", "units", "pulses", "Hz", "motion s", "pause s", "output", "wait", "stop")

app = App(
    name="stepper",
    help="What only the stepper controller can do.",
    help_epilogue="",
    group_arguments=Group.create_default_parameters(),
)
command = partial(device_command, app, Controller, Device)


# -- programs ------------------------------------------------------------------------------------------


@family_command(
    app,
    "check FILE",
    "Opens no port. Exit code 1 if a finding is an error.",
    "check examples/pick_and_place.toml",
    "check feed.toml --unattended --highest 20000",
)
def check(
    file: File,
    /,
    *,
    highest: Annotated[float, Parameter(help="Frequency (Hz) that the driver follows.")] = 100_000.0,
    unattended: Annotated[bool, Parameter(negative="", help="No operator is present.")] = False,
    output: Silent,
) -> Exit:
    """Show the steps and the duration of a program, and its mistakes."""
    program = Program.load(file)
    duration, found = program.estimate(), program.lint(highest=highest, unattended=unattended)
    rows = [_step_row(program, number) for number in estimate.numbers(program.project)]
    facts = [{"rule": one.rule, "level": one.level, "step": one.step, "text": one.text} for one in found]
    times = {name: getattr(duration, name) for name in duration.__struct_fields__}
    output.document("motorbus.stepper.check/1", {"file": file, "findings": facts, "estimate": times})
    output.table(program.name or file, [f">{column}" for column in COLUMNS], rows)
    output.text("\n".join([str(duration), *(str(one) for one in found)]))
    return Exit.FAILURE if any(one.level == "error" for one in found) else Exit.OK


def _step_row(program: Program, number: int) -> list[object]:
    project, step = program.project, program.project.step(number)
    move = [ramp.pulses_of(project, step), f"{ramp.ramp_of(project, step).run:.6g}"]
    seconds = [f"{estimate.step_seconds(project, step):.3f}", f"{step.delay / 1000:g}"]
    action = PARAMETERS["output"].choices[step.output] if step.output else ""
    units_ = step.sign * step.distance
    ports = [step.start_input or "", step.stop_input or ""]
    return [number, sequence.times(project, number), units_, *move, *seconds, action, *ports]


@command(
    "write FILE BUS",
    "Shows what differs and asks. Only that is sent; the project is then read back, saved\n"
    "and read back again. A file of `read --all` restores its projects.",
    "write feed.toml stepper:/dev/ttyUSB0 --project 3",
    "write examples/pick_and_place.toml stepper:sim --dry-run",
)
def write(
    file: File,
    run: Run,
    /,
    *,
    project: Number = None,
    save: Annotated[bool, Parameter(help="Save it; else power-off loses it.")] = True,
    expert: Expert = False,
) -> Exit:
    """Write a program into a project, or a backup into all of its projects, verified."""
    source = read_text(file)
    backup = Backup.parse(source) if read_toml(source).get("kind") == KIND else None
    if backup and not save:
        raise RequestError("a backup is always saved", advice="leave --no-save out; nothing was sent")
    if backup:
        chosen = backup.projects if project is None else (project,)
        programs = [Program(project=replace(backup.project(number), number=number)) for number in chosen]
    else:
        program = Program.parse(source)
        number = project or program.project.number
        programs = [replace(program, project=replace(program.project, number=number))]

    def action(one: Controller) -> tuple[Written, ...]:
        if backup:
            return one.restore(backup, chosen)
        return (one.write_project(programs[0], save=save, expert=expert),)

    with target.opened(run.bus, run.options, run.output) as bus:
        one = Controller(bus)
        changed = [number for wanted in programs if (number := _show_changes(one, wanted, run.output))]
        rehearsal = dry.DryBus(bus)
        if run.dry_run:
            action(Controller(rehearsal))
            dry.show(rehearsal, run.output)
            return Exit.OK
        question = f"write project {', '.join(map(str, changed))}"
        agreed = run.yes or not changed
        consent.consent_to(question, run.output, yes=agreed, rehearse=lambda: action(Controller(rehearsal)))
        results = action(one)
    return run.show({"projects": [written(one) for one in results]}, "\n".join(map(str, results)))


def _show_changes(one: Controller, wanted: Program, output: Output) -> int:
    """Show what a write would change; return the number of the project, 0 if nothing changes."""
    number = wanted.project.number
    if wanted.project.is_cleared:
        is_filled = not one.read_project(number).project.is_cleared
        output.text(f"project {number}: to be cleared" if is_filled else f"project {number}: is cleared")
        return number if is_filled else 0
    rows = [(name, old, new) for name, (old, new) in one.difference(wanted).items()]
    if rows:
        output.table(f"project {number}", ("parameter", ">now", ">new"), rows)
    return number if rows else 0


@command(
    "read BUS",
    "Two readings must agree. The result is a program file, or with --all a backup file.",
    "read stepper:/dev/ttyUSB0 --project 2 > feed.toml",
    "read stepper:/dev/ttyUSB0 --all > controller.toml",
    consent="",
    dry_run=False,
)
def read(
    run: Run,
    /,
    *,
    project: Number = None,
    all_: Annotated[bool, Parameter(name="--all", negative="", help="A backup of all projects.")] = False,
) -> Exit:
    """Read a project as a program file, project 1 by default, or all of them as a backup file."""
    with target.opened(run.bus, run.options, run.output) as bus:
        one = Controller(bus)
        source = f"# read from {run.bus}{' (simulated)' if bus.simulated else ''}\n"
        text = one.backup().text() if all_ else one.read_project(project or 1).text()
    text = source + text
    return run.show({"text": text}, text.rstrip("\n"))


# -- run -----------------------------------------------------------------------------------------------

_ERRORS: Final[Mapping[Outcome, type[MotorbusError]]] = {
    Outcome.STOPPED: Interrupted,
    Outcome.TIMEOUT: NoReply,
    Outcome.UNKNOWN: OutcomeUnknown,
}


@command(
    "run BUS",
    "Exit code 0 if its notice came, 5 if none came in time, 10 if it was stopped, 1 if\n"
    "unknown. Ctrl-C ends the wait, not the project: `motorbus stop` does.",
    "run stepper:/dev/ttyUSB0 --project 2 --watch 1,2",
    "run stepper:sim --project 1 --yes",
    consent="a way of more than 180 degrees",
)
def run(
    run: Run,
    /,
    *,
    project: Annotated[int, Parameter(help="Project 1 to 4.")],
    timeout: Annotated[str, Parameter(help="Longest wait, as 90s; else by its estimate.")] = "",
    watch: Annotated[str, Parameter(help="Inputs to read meanwhile, as 1,2.")] = "",
    endless: Endless = False,
    expert: Expert = False,
) -> Exit:
    """Start a project and wait for its end."""
    seconds = units.parse(timeout, "time") if timeout else None
    ports = [int(port) if port.isdigit() else 0 for port in watch.split(",")] if watch else []
    common: dict[str, Any] = {"endless": endless, "expert": expert}
    with target.opened(run.bus, run.options, run.output) as bus:
        one, rehearsal = Controller(bus), dry.DryBus(bus)
        start = partial(Controller(rehearsal).start_project, project, **common)
        if run.dry_run:
            start()
            dry.show(rehearsal, run.output)
            return Exit.OK
        question = _far(one.read_project(project))
        consent.consent_to(
            f"start project {project}, {question}", run.output, yes=run.yes or not question, rehearse=start
        )
        procedure = Controller.run.function(one, project, timeout=seconds, watch=ports, **common)
        with run.output.progress(f"project {project}") as bar:
            try:
                ran: Ran = bus.run(procedure, report=partial(_report, run.output, bar))
            except (KeyboardInterrupt, SystemExit):
                run.output.note(f"project {project} may still run: `motorbus stop {run.bus}` ends it")
                raise
    took = "" if ran.seconds is None else f" in {ran.seconds:.3f} s"
    facts = {"project": project, "outcome": ran.outcome.value, "seconds": ran.seconds, "why": ran.why}
    run.show(facts, f"project {project} {ran.outcome.value}{took}: {ran.why}\nestimate: {ran.predicted}")
    if error := _ERRORS.get(ran.outcome):
        advice = "" if ran.outcome is Outcome.STOPPED else "it may still run: `motorbus stop` ends it"
        raise error(f"project {project}: {ran.outcome.value}: {ran.why}", advice=advice)
    return Exit.OK


def _far(program: Program) -> str:
    """Why a start needs consent; "" if it does not."""
    project = program.project
    if project.is_endless:
        return "which has no end"
    farthest = max(map(abs, estimate.reach(project)))
    angle = farthest * tau / (project.turn_distance or 1)
    return f"which turns by up to {units.show(angle, 'position')}" if angle > consent.FAR else ""


def _report(output: Output, bar: Bar, event: object) -> None:
    """Show the progress of a run, and changes of inputs."""
    if isinstance(event, Progress):
        bar.advance(event.done, event.total, event.what)
    elif isinstance(event, InputChanged):
        output.document("motorbus.stepper.input/1", event._asdict())
        output.text(f"{event.at:.3f} s: input {event.port} {WORDS[event.active]}")


# -- inputs and outputs --------------------------------------------------------------------------------


@command(
    "io BUS [PORT=LEVEL...]",
    "Without PORT=LEVEL it reads the inputs, each by two equal readings; `motorbus monitor`\n"
    "watches them. Outputs cannot be read; what is connected to one may move.",
    "io stepper:/dev/ttyUSB0",
    "io stepper:sim 1=on leds=off",
    consent="",
)
def io(
    run: Run,
    /,
    *levels: Annotated[str, Parameter(name="PORT=LEVEL", help="1, 2, 3, all or leds; on or off.")],
) -> Exit:
    """Read the inputs, or set outputs."""
    wanted = [_level(text) for text in levels]

    def set_all(one: Controller) -> dict[int, bool | None]:
        for port, active in wanted:
            one.set_output(port, active)
        return dict(one.last_commanded)

    name = "last_commanded" if wanted else "inputs"
    found = run.write(set_all) if wanted else run.read(lambda one: one.inputs())
    shown = {f"{'output' if wanted else 'input'} {port}": WORDS[active] for port, active in found.items()}
    return run.show({name: {str(port): active for port, active in found.items()}}, **shown)


def _level(text: str) -> tuple[int, bool]:
    port, _, level = text.partition("=")
    if port not in PORTS or level not in LEVELS:
        raise RequestError(f"{text} is no PORT=LEVEL", expected="1, 2, 3, all or leds, = on or off")
    return PORTS[port], LEVELS[level]


# -- what the commands of all families use of this family ----------------------------------------------

COMMANDS: Final = {
    "write_project()": "`motorbus stepper write`",
    "backup()": "`motorbus stepper read --all`",
    "restore()": "`motorbus stepper write`",
    "run()": "`motorbus stepper run`",
    "jog()": "`motorbus jog`",
    "move_by()": "`motorbus move BUS#1+=ANGLE`",
    "home()": "`motorbus home`",
    "set_output()": "`motorbus stepper io BUS PORT=LEVEL`",
    "inputs()": "`motorbus stepper io BUS`",
    "expert=True": "--expert",
    "endless=True": "--endless",
}
"""A call in an error text -> the command that does the same."""
KEPT: Final = "the stored project"


def written(result: Written) -> dict[str, object]:
    """For `motorbus write`: the result as plain data."""
    changes = {name: list(pair) for name, pair in result.changes.items()}
    return {"project": result.project, "proof": result.proof, "changes": changes}


def sample(one: Controller) -> dict[str, object]:
    """For `motorbus monitor`: the levels of the inputs, the only live state of the controller."""
    return {f"input_{port}": active for port, active in one.inputs().items()}


def as_written(driver: Any, read: Mapping[Any, Any], withheld: list[bytes], request: Any) -> bytes | None:
    """For a dry run: the reply to a request after the frames that were withheld; None if it is unknown."""
    asked = decode_request(request)
    if asked is None or asked[0].name != "read_project":
        return None
    images = {number: read.get(encode("read_project", project=number)) for number in range(1, PROJECTS + 1)}
    stored = {number: dump[REPLY_LENGTH:] for number, dump in images.items() if dump}
    selected, working = 0, b""
    for frame in withheld:
        decoded = decode_request(frame)
        if decoded is None:
            continue
        row, values = decoded
        if row.name == "select_project":
            selected, working = values["project"], stored.get(values["project"], b"")
        if row.is_edit and working:
            project = edited(decode_image(working, driver.order), row.name, values)
            working = encode_image(project, driver.order, over=working)
        elif row.name == "save_project":
            stored[values["project"]] = working
        elif row.name == "clear_project":
            stored[values["project"]] = BLANK
            working = BLANK if values["project"] == selected else working
    number = asked[1]["project"]
    image = working if number == selected else stored.get(number)
    return encode_reply(request, image=image) if image else None
