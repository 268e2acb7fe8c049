"""`motorbus stepper run`: a stored project started, and its end waited for."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Final

from motorbus.cli.consent import FAR
from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.stepper.controller import BusName, BusOption, ProjectNumber, carried_out, numbers_in, verb
from motorbus.cli.stepper.files import app
from motorbus.cli.target import face
from motorbus.core import units
from motorbus.errors import Interrupted, MotorbusError, NoReply, OutcomeUnknown
from motorbus.families.stepper.driver.goals import of_project
from motorbus.families.stepper.driver.inputs import InputChanged
from motorbus.families.stepper.driver.progress import Estimated
from motorbus.families.stepper.driver.waiting import Outcome, Ran

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Bar, Output

_ENDS: Final[Mapping[Outcome, type[MotorbusError]]] = {
    Outcome.STOPPED: Interrupted,
    Outcome.TIMEOUT: NoReply,
    Outcome.UNKNOWN: OutcomeUnknown,
}
"""The error that stands for an outcome, and so its exit code; `completed` is 0."""
_CODES: Final = """Ends with 0 when the notice of its end came and could be true, 5 when none came
in time, 10 when it was stopped meanwhile, 1 when that cannot be known."""


@app.command(
    usage="Usage: motorbus stepper run BUS --project PROJECT [OPTIONS]",
    help_epilogue=f"""{_CODES}

Where it is meanwhile nobody can ask: what is shown is a model that runs beside
it, *estimated*, and knows of an operator's buttons only where --watch has them
read. Ctrl-C ends the waiting, not the project: `motorbus stop` does. A way of
more than 180 degrees needs --yes.

Examples:

    motorbus stepper run stepper:/dev/ttyUSB0 --project 2
    motorbus stepper run stepper:COM7 --project 2 --watch 1,2 --progress
    motorbus stepper run stepper:/dev/ttyUSB0 --project 2 --timeout 5min --yes
    motorbus stepper run stepper:sim --project 1 --yes
    motorbus stepper run stepper:sim --project 1 --dry-run""",
)
def run(
    bus: BusName,
    /,
    *,
    project: ProjectNumber,
    timeout: str = "",
    watch: str = "",
    progress: Flag = False,
    endless: Flag = False,
    stop_first: Flag = False,
    expert: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Start a stored project, and wait for its end.

    Parameters
    ----------
    timeout
        Wait so long, as 90s or 5min; as long as it takes in the slowest reading, and some more, when left out.
    watch
        Inputs to read all the while, as 1,2.
    progress
        Tell every quarter of a second where it should be, and each input that changes.
    endless
        Allow a project without an end; it needs --timeout.
    stop_first
        Stop what may still run.
    expert
        Start it although it has findings that are errors.
    yes
        Do not ask before a way of more than 180 degrees.
    """
    chosen: dict[str, Any] = {
        "endless": endless,
        "stop_first": stop_first,
        "expert": expert,
    }
    seconds, ports = units.parse(timeout, "time") if timeout else None, numbers_in(watch) if watch else ()
    agreed = "" if yes else partial(_question, project)
    told: Ran | None = carried_out(
        bus, options, output, verb("run", project, **chosen, timeout=seconds, watch=ports),
        what=f"project {project}", consent=agreed, dry_run=dry_run,
        rehearse=verb("start_project", project, **chosen), hear=partial(heard, progress, output),
    )  # fmt: skip
    return Exit.OK if told is None else _ended(project, told, output)


def _question(project: int, bus: Bus) -> str:
    one = face(bus, 1)
    goals = of_project(one, one.read_project(project).project)
    if any(goal.quantity == "velocity" for goal in goals):
        return f"start project {project}, which goes on until it is stopped"
    far = max((goal.value for goal in goals if goal.quantity == "relative"), key=abs)
    if abs(far) <= FAR:
        return ""
    return f"start project {project}, which goes up to {units.show(far, 'position')} from where it stands"


def heard(told: bool, output: Output, event: object, bar: Bar) -> None:
    """Show where it should be, as a bar, and in words where these are to be told."""
    if isinstance(event, Estimated):
        bar.advance(event.fraction or 0.0, 1.0, _where(event))
        if told:
            output.document("motorbus.stepper.estimated/1", {"estimated": True, **event._asdict()})
            output.text(_where(event))
    elif isinstance(event, InputChanged) and told:
        output.document("motorbus.stepper.input/1", event._asdict())
        output.text(f"input {event.port} {'active' if event.active else 'inactive'}")


def _where(event: Estimated) -> str:
    through = "" if event.fraction is None else f" {100 * event.fraction:.0f} %,"
    passes = f" of {event.passes}" if event.passes else ""
    step = f"step {event.step}" if event.step else "over"
    waits = f", waits for input {event.waiting_for}" if event.waiting_for else ""
    place = units.show(event.position, "position")
    return f"estimated:{through} pass {event.round}{passes}, {step}{waits}, {place} from the start"


def _ended(project: int, told: Ran, output: Output) -> Exit:
    """Print what came of it. Raises Interrupted, NoReply or OutcomeUnknown for what is not `completed`."""
    facts = {"project": project, "outcome": told.outcome.value, "seconds": told.seconds, "why": told.why}
    predicted = told.predicted
    output.document("motorbus.stepper.run/1", {**facts, "predicted": plain(predicted.data())})
    took = "" if told.seconds is None else f" in {told.seconds:.3f} s"
    output.text(f"project {project} {told.outcome.value}{took}: {told.why}\npredicted: {predicted}")
    if (kind := _ENDS.get(told.outcome)) is not None:
        raise kind(
            f"project {project}: {told.outcome.value}: {told.why}",
            advice="" if told.outcome is Outcome.STOPPED else "it may still run: `motorbus stop` ends it",
        )
    return Exit.OK
