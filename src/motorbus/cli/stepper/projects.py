"""`motorbus stepper read-project`: one of the four, as a program or as it came."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.parameters import Silent
from motorbus.cli.plain import plain
from motorbus.cli.stepper.controller import BusName, BusOption, ProjectNumber, carried_out
from motorbus.cli.stepper.files import app
from motorbus.families.stepper import Program
from motorbus.families.stepper.driver import Node, reading
from motorbus.families.stepper.table import check


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
