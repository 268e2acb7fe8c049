"""`motorbus stepper characterise`: find out how one controller reads what its manual leaves open; kept as a file."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, verb
from motorbus.cli.stepper.files import app
from motorbus.families.stepper.driver.characterising import experiments
from motorbus.families.stepper.driver.characterising.study import Experiment

if TYPE_CHECKING:
    from motorbus.cli.output import Bar, Output
    from motorbus.families.stepper.program.profile import Profile

Where = Annotated[Path | None, Parameter(name="FILE", help="Where the profile goes: TOML, for --profile.")]


@app.command(
    usage="Usage: motorbus stepper characterise BUS FILE [OPTIONS]",
    help_epilogue="""TAKE THE LOAD OFF THE MOTOR FIRST. It turns now and then for a minute
and a half, by up to 240 RPM and --travel turns each way, and is timed by the
notices of its runs. Nothing is saved: in the end every project reads as
before, and a power cycle brings the same. If this is cut off, `motorbus
recover` puts it back.

A question that no experiment separates stays open, and the file says why.
`run`, `check`, `estimate`, `order` and `show` take the file as --profile.

Examples:

    motorbus stepper characterise stepper:/dev/ttyUSB0 ours.toml
    motorbus stepper characterise stepper:COM7 ours.toml --travel 5 --yes
    motorbus stepper characterise stepper:sim --plan""",
)
def characterise(
    bus: BusName,
    file: Where = None,
    /,
    *,
    scratch: int = 4,
    travel: float = 1.0,
    plan: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Find out how a controller reads what its manual leaves open.

    Parameters
    ----------
    scratch
        The project that is lent for it, 1 to 4.
    travel
        Turns that the motor may go each way, 0.5 to 100.
    plan
        Say what would be tried, and do nothing.
    yes
        Do not ask before the motor turns, or before a file is replaced.
    """
    if plan:
        return _planned(travel, output)
    do = verb("characterise", scratch=scratch, travel=travel)
    if file is not None and file.exists():
        consent_to(f"replace {file}", output, yes=yes or dry_run)
    question = f"turn the motor, its load taken off, by up to {travel:g} turns each way for about a minute and a half"
    found: Profile | None = carried_out(
        bus,
        options,
        output,
        do,
        what="characterise",
        consent="" if yes else question,
        dry_run=dry_run,
        hear=partial(_heard, output),
    )
    if found is not None:
        _kept(found, file, output)
    return Exit.OK


def _planned(travel: float, output: Output) -> Exit:
    found = experiments(travel=travel)
    output.document("motorbus.stepper.experiments/1", {"experiments": plain(found)})
    rows = [
        (one.name, one.what, ", ".join(one.settles), f"{one.turns:g}", f"{one.seconds:.1f}") for one in found
    ]
    output.table("Experiments", ["name", "what", "settles", ">turns", ">s"], rows)
    return Exit.OK


def _heard(output: Output, event: object, bar: Bar) -> None:
    if isinstance(event, Experiment):
        bar.say(f"{event.name}: {event.what}")
        if not bar.shown:
            output.note(f"{event.name}: {event.what}")


def _kept(found: Profile, file: Path | None, output: Output) -> None:
    if file is not None:
        with usable(file, "written"):
            file.write_text(found.text(), encoding="utf-8")
    facts = {"settled": plain(found.settled), "evidence": plain(found.evidence)}
    facts |= {"measured": plain(found.measured), "open": plain(found.open)}
    output.document("motorbus.stepper.profile/1", {**facts, "file": str(file) if file else None})
    rows = [(name, value, found.evidence.get(name, "")) for name, value in found.settled.items()]
    rows += [(name, "open", why) for name, why in found.open.items()]
    output.table("Profile", ["question", "reading", "why"], rows)
    for name, figure in found.measured.items():
        output.text(f"{name}: {figure:.6g}")
    if file is not None:
        output.text(f"kept in {file}")
