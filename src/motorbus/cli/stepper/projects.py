"""`motorbus stepper select-project|read-project|save-project|clear-project`: one of the four, as a whole."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.stepper.controller import (
    BusName,
    BusOption,
    ProjectNumber,
    carried_out,
    unless_lent,
    verb,
)
from motorbus.cli.stepper.files import app
from motorbus.cli.stepper.writing import result
from motorbus.families.stepper import Program
from motorbus.families.stepper.driver import Node, commands, reading
from motorbus.families.stepper.table import check

if TYPE_CHECKING:
    from motorbus.core.steps import Procedure


@app.command(
    usage="Usage: motorbus stepper select-project BUS --project PROJECT [OPTIONS]",
    help_epilogue="""One command selects a project and sets how many steps it has. So without
--total-steps the project is read first, and keeps the number it has; a project
that was cleared has none, and cannot be selected so. Edits of another project
that were not saved are lost, or so it is assumed.

Examples:

    motorbus stepper select-project stepper:/dev/ttyUSB0 --project 2
    motorbus stepper select-project stepper:sim --project 2 --total-steps 3
    motorbus stepper select-project stepper:sim --project 1 --dry-run""",
)
def select_project(
    bus: BusName,
    /,
    *,
    project: ProjectNumber,
    total_steps: int | None = None,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Select the project that edits go to (item 1 of the manual).

    Parameters
    ----------
    total_steps
        Give it so many steps, 1 to 10; as many as it has when left out.
    """
    do = verb("select", project) if total_steps is None else partial(_selected, project, total_steps)
    carried_out(bus, options, output, do, dry_run=dry_run)
    if not dry_run:
        facts = {"project": project, "total_steps": total_steps, "accepted": True}
        output.document("motorbus.stepper.select-project/1", facts)
        count = "with the number of steps it had" if total_steps is None else f"with {total_steps} steps"
        output.text(f"project {project} is selected, {count}")
    return Exit.OK


def _selected(project: int, steps: int, one: Node) -> Procedure[None]:
    return unless_lent(one, "select_project", commands.select_project(one, project, steps))


@app.command(
    usage="Usage: motorbus stepper read-project BUS --project PROJECT [OPTIONS]",
    help_epilogue="""Two readings must agree, for a dump has no checksum. What is printed is a
program, as `write` takes it; a file that does not end in .toml gets the 226
bytes as they came. `backup` keeps all four.

Examples:

    motorbus stepper read-project stepper:/dev/ttyUSB0 --project 2 > feed.toml
    motorbus stepper read-project stepper:sim --project 1
    motorbus stepper read-project stepper:sim --project 1 --json""",
)
def read_project(
    bus: BusName,
    /,
    *,
    project: ProjectNumber,
    output_: Path | None = None,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read what is stored or edited of a project (item 15 of the manual).

    Parameters
    ----------
    output_
        A file to write: a program (.toml), or else the dump.
    """
    data, text = carried_out(bus, options, output, partial(_read, project)) or (b"", "")
    if output_ is not None:
        with usable(output_, "written"):
            output_.write_bytes(text.encode() if output_.suffix.lower() == ".toml" else data)
    facts = {
        "project": project,
        "dump": plain(data),
        "program": text or None,
        "file": str(output_) if output_ else None,
    }
    output.document("motorbus.stepper.read-project/1", facts)
    shown = text.rstrip("\n") or f"project {project} has been cleared: it has no steps"
    output.text(f"written: {output_}" if output_ else shown)
    return Exit.OK


async def _read(project: int, one: Node) -> tuple[bytes, str]:
    check("read_project", {"project": project})
    data = await reading.dump(one, project)
    program = Program.from_dump(data, name=f"project {project}", order=one.order)
    return data, "" if program.project.is_cleared else program.text()


@app.command(
    usage="Usage: motorbus stepper save-project BUS --project PROJECT [OPTIONS]",
    help_epilogue="""Asks first: whatever is being edited is stored then, also if that is another
project, and what was stored is gone. It is read before and after, and what
that proves is said: only a power cycle shows for sure what is stored. `write`
saves what it writes.

Examples:

    motorbus stepper save-project stepper:/dev/ttyUSB0 --project 2
    motorbus stepper save-project stepper:sim --project 1 --yes
    motorbus stepper save-project stepper:/dev/ttyUSB0 --project 1 --dry-run""",
)
def save_project(
    bus: BusName,
    /,
    *,
    project: ProjectNumber,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Keep what is edited as this project when the supply goes (item 16 of the manual).

    Parameters
    ----------
    yes
        Do not ask before.
    """
    question = "" if yes else f"save whatever is being edited as project {project}, for good"
    told = carried_out(
        bus, options, output, verb("save", project, expert=True), consent=question, dry_run=dry_run
    )
    if told is not None:
        output.document("motorbus.stepper.save-project/1", result(told))
        output.text(str(told))
    return Exit.OK


@app.command(
    usage="Usage: motorbus stepper clear-project BUS --project PROJECT [OPTIONS]",
    help_epilogue="""Asks first: all of it is zero then, what is stored and what is edited. Project
1 needs --expert, for jog, single move and homing have their speed from its
step 1. `read-project` or `backup` before keeps what it was.

Examples:

    motorbus stepper clear-project stepper:/dev/ttyUSB0 --project 4
    motorbus stepper clear-project stepper:sim --project 4 --yes
    motorbus stepper clear-project stepper:sim --project 1 --expert --dry-run""",
)
def clear_project(
    bus: BusName,
    /,
    *,
    project: ProjectNumber,
    expert: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Set all of a project to zero (item 17a of the manual).

    Parameters
    ----------
    expert
        Allow it for project 1.
    yes
        Do not ask before.
    """
    question = "" if yes else f"clear project {project}, for good"
    do = verb("clear", project, expert=expert)
    before = carried_out(bus, options, output, do, consent=question, dry_run=dry_run)
    if not dry_run:
        facts = {"project": project, "cleared": True, "before": plain(before)}
        output.document("motorbus.stepper.clear-project/1", facts)
        output.text(f"project {project} is cleared: all of it reads zero")
    return Exit.OK
