"""`motorbus stepper write|diff`: a program put into a controller, told beforehand what differs and what that costs."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, verb
from motorbus.cli.stepper.files import DumpOrder, File, app, loaded
from motorbus.cli.target import face
from motorbus.families.stepper.driver import writing

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Bar, Output
    from motorbus.families.stepper import Program


@app.command(
    usage="Usage: motorbus stepper diff FILE BUS [OPTIONS]",
    help_epilogue="""Only reads. Ends with exit code 0 when nothing differs, and with 1 when
something does.

Examples:

    motorbus stepper diff feed.toml stepper:/dev/ttyUSB0
    motorbus stepper diff feed.toml stepper:/dev/ttyUSB0 --project 3 --json""",
)
def diff(
    file: File,
    bus: BusName,
    /,
    *,
    project: int | None = None,
    dump_order: DumpOrder = "",
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Say in what a program differs from what a controller holds, and what writing it would cost.

    Parameters
    ----------
    project
        Compare with this project; with the one that the file names when left out.
    """
    program = loaded(file, dump_order or "little")
    options = {**options, **({"dump_order": dump_order} if dump_order else {})}
    found = carried_out(bus, options, output, verb("difference", program, project), what="reading")
    output.document("motorbus.stepper.diff/1", facts(found))
    output.text(str(found))
    return Exit.FAILURE if found else Exit.OK


@app.command(
    usage="Usage: motorbus stepper write FILE BUS [OPTIONS]",
    help_epilogue="""Shows what differs, and how many frames and seconds writing it takes, and asks;
only what differs is sent. Then the project is read back, saved, and read back
again; what that proves is said. Findings of `check` that are errors are
refused, unless --expert is said. Without --save a power cycle takes it away.

Examples:

    motorbus stepper write feed.toml stepper:/dev/ttyUSB0
    motorbus stepper write feed.toml stepper:/dev/ttyUSB0 --project 3 --yes
    motorbus stepper write feed.toml stepper:/dev/ttyUSB0 --no-save --yes
    motorbus stepper write feed.toml stepper:/dev/ttyUSB0 --dry-run""",
)
def write(
    file: File,
    bus: BusName,
    /,
    *,
    project: int | None = None,
    save: bool = True,
    expert: Flag = False,
    dump_order: DumpOrder = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Write a program into a project of a controller, verified.

    Parameters
    ----------
    project
        Which project, 1 to 4; the one that the file names when left out.
    save
        Save it, so that it is kept when the supply goes.
    expert
        Write it although it has findings that are errors.
    yes
        Do not ask before.
    """
    program = loaded(file, dump_order or "little")
    options = {**options, **({"dump_order": dump_order} if dump_order else {})}
    met: list[writing.Difference] = []
    told: writing.Written | None = carried_out(
        bus,
        options,
        output,
        verb("write_project", program, project, save=save, expert=expert),
        what="writing",
        consent="" if yes else partial(_question, program, project, met, output),
        dry_run=dry_run,
        hear=partial(_planned, met, output),
    )
    if told is None:
        return Exit.OK
    plan = facts(met[-1]) if met else None
    output.document("motorbus.stepper.write/1", {"difference": plan, **result(told)})
    output.text(str(told))
    return Exit.OK


def _question(
    program: Program, project: int | None, met: list[writing.Difference], output: Output, bus: Bus
) -> str:
    found: writing.Difference = face(bus, 1).difference(program, project)
    _show(found, met, output)
    return f"write project {found.project}" if found else ""


def _planned(met: list[writing.Difference], output: Output, event: object, bar: Bar) -> None:
    if isinstance(event, writing.Planned) and not met:
        _show(event.difference, met, output)


def _show(found: writing.Difference, met: list[writing.Difference], output: Output) -> None:
    met.append(found)
    output.text(str(found))


def facts(found: Any) -> dict[str, object]:
    """A difference as plain data."""
    changes = [
        {
            "name": change.name,
            "step": change.step or None,
            "before": change.before,
            "after": change.after,
            "unit": change.row.unit,
            "raw_before": change.raw_before,
            "raw_after": change.raw_after,
        }
        for change in found.changes
    ]
    return {
        "project": found.project,
        "changes": changes,
        "commands": [edit.command for edit in found.edits],
        "cost": plain(found.cost),
        "reserved": plain(found.reserved),
    }


def result(told: writing.Written) -> dict[str, object]:
    """What was written, and what is known of it, as plain data."""
    return {
        "project": told.project,
        "changed": len(told.changes),
        "more": [change.name for change in told.more],
        "shared": list(told.shared),
        "commands": told.commands,
        "dumps": told.dumps,
        "seconds": told.seconds,
        "saved": told.saved,
        "proof": plain(told.proof),
        "reserved": plain(told.reserved),
        "text": str(told),
    }
