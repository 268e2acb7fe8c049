"""`motorbus stepper backup|restore`: what a controller has stored, taken out into a file and put back."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from motorbus import __version__
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, numbers_in, verb
from motorbus.cli.stepper.files import LONGEST, app
from motorbus.cli.stepper.writing import result
from motorbus.cli.target import face
from motorbus.errors import RequestError
from motorbus.families.stepper.driver import writing
from motorbus.families.stepper.program.backups import Backup

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Bar, Output

BackupFile = Annotated[Path, Parameter(name="FILE", help="The backup: TOML, with each dump as it came.")]
Projects = Annotated[str, Parameter(help="Which projects, as 1,3 or 1-4; all when left out.")]


@app.command(
    usage="Usage: motorbus stepper backup BUS FILE [OPTIONS]",
    help_epilogue="""Only reads: each project until two dumps agree, 2 s for all four. The file has
the bytes as they came, each with a checksum, and in comments what they say.
Asks before it replaces a file.

Examples:

    motorbus stepper backup stepper:/dev/ttyUSB0 controller.toml
    motorbus stepper backup stepper:/dev/ttyUSB0 feed.toml --projects 2""",
)
def backup(
    bus: BusName,
    file: BackupFile,
    /,
    *,
    projects: Projects = "1-4",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Read what a controller has stored into a file.

    Parameters
    ----------
    yes
        Do not ask before a file is replaced.
    """
    do = verb("backup", numbers_in(projects))
    consent_to(f"replace {file}", output, yes=yes or dry_run or not file.exists())
    found: Backup | None = carried_out(bus, options, output, do, what="reading", dry_run=dry_run)
    if found is None:
        return Exit.OK
    made = datetime.now(UTC).isoformat(timespec="seconds")
    with usable(file, "written"):
        file.write_text(replace(found, made=made, version=f"motorbus {__version__}").text(), encoding="utf-8")
    kept = {str(number): not found.project(number).is_cleared for number in found.projects}
    output.document("motorbus.stepper.backup/1", {"file": str(file), "made": made, "projects": kept})
    rows = [(number, found.project(int(number)).total_steps or "cleared") for number in kept]
    output.table(f"Kept in {file}", [">project", "steps"], rows)
    return Exit.OK


@app.command(
    usage="Usage: motorbus stepper restore FILE BUS [OPTIONS]",
    help_epilogue="""Shows what differs and what writing it costs, project by project, and asks.
Each is written, read back, saved and read back again; one that was cleared is
cleared. Bytes that the manual does not name cannot be written: which of them
differ is said.

Examples:

    motorbus stepper restore controller.toml stepper:/dev/ttyUSB0
    motorbus stepper restore controller.toml stepper:COM7 --projects 2 --yes
    motorbus stepper restore controller.toml stepper:/dev/ttyUSB0 --dry-run""",
)
def restore(
    file: BackupFile,
    bus: BusName,
    /,
    *,
    projects: Projects = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Put back what a backup has of a controller.

    Parameters
    ----------
    yes
        Do not ask before.
    """
    kept = loaded(file)
    numbers = numbers_in(projects) if projects else kept.projects
    for number in numbers:
        kept.image(number)  # raises when it is not in it
    told: tuple[writing.Written, ...] | None = carried_out(
        bus,
        options,
        output,
        verb("restore", kept, numbers),
        what="restoring",
        consent="" if yes else partial(_question, kept, numbers, output),
        dry_run=dry_run,
        hear=partial(_planned, output, yes=yes or dry_run),
    )
    if told is not None:
        output.document("motorbus.stepper.restore/1", {"projects": [result(one) for one in told]})
        for one in told:
            output.text(f"{one}{_unwritten(one)}")
    return Exit.OK


def loaded(file: Path) -> Backup:
    """The backup in this file. Raises RequestError, with its name, for what is none."""
    with usable(file, "read"):
        data = file.read_bytes()
    if len(data) > LONGEST:
        raise RequestError(f"{file} has {len(data)} bytes", expected=f"{LONGEST} at most")
    try:
        return Backup.parse(data.decode())
    except UnicodeDecodeError as error:
        raise RequestError(f"{file} is no text: {error.reason}", expected="TOML in UTF-8") from None
    except RequestError as error:
        error.summary = f"{file}: {error.summary}"
        raise


def _question(kept: Backup, numbers: tuple[int, ...], output: Output, bus: Bus) -> str:
    """What would be done, as far as anything would."""
    touched = []
    for number in numbers:
        one = face(bus, 1)
        if kept.project(number).is_cleared:
            differs = not one.read_project(number).project.is_cleared
            output.text(f"project {number}: {'cleared, as in the backup' if differs else 'nothing differs'}")
        else:
            differs = one.difference(kept.program(number), number)
            output.text(str(differs))
        touched += [str(number)] if differs else []
    return f"write project {', '.join(touched)}" if touched else ""


def _planned(output: Output, event: object, bar: Bar, *, yes: bool) -> None:
    """Without a question the difference is shown before the first command leaves."""
    if yes and isinstance(event, writing.Planned):
        output.text(str(event.difference))


def _unwritten(one: writing.Written) -> str:
    places = ", ".join(map(str, one.reserved))
    return f"\n  bytes that nobody can write differ at {places} of its 220" if places else ""
