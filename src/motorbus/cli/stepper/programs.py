"""`motorbus stepper check|estimate|order`: what a program does wrong, how long, in which order. Opens no port."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.parameters import Flag, Silent
from motorbus.cli.stepper.files import CLEARED, DumpOrder, File, Readings, app, each, loaded, reading
from motorbus.errors import RequestError
from motorbus.families.stepper import Conditions, Finding, Plan
from motorbus.families.stepper.table import Project


@app.command(
    help_epilogue="""Ends with exit code 1 if any finding is an error, with --strict if there is
any finding at all, and with 2 if a file is no program; the others are judged
all the same.

Examples:

    motorbus stepper check examples/pick_and_place.toml
    motorbus stepper check --unattended --highest 20000 *.toml
    motorbus stepper check --before backup/project1.bin jog.toml""",
)
def check(
    *files: File,
    highest: float = 100_000.0,
    longest: float = 3600.0,
    longest_total: float = 28_800.0,
    before: Path | None = None,
    homing: Flag = False,
    unattended: Flag = False,
    strict: Flag = False,
    dump_order: DumpOrder = "little",
    output: Silent,
    **readings: Readings,
) -> Exit:
    """Say what in a program will not do what it seems to say.

    Parameters
    ----------
    highest
        Hz that the driver follows.
    longest
        s that a pause may have.
    longest_total
        s that all pauses of a run may have together; of one pass, when it is endless.
    before
        What project 1 holds now (a program or a dump): jog, single move and homing run with its step 1, and a program
        for project 1 is told what it changes for them.
    homing
        Input 5 is used for homing.
    unattended
        Nobody is there to press a button.
    strict
        Any finding is a failure.
    """
    conditions = Conditions(
        **_limits(highest=highest, longest=longest, longest_total=longest_total),
        homing=homing,
        unattended=unattended,
        before=_before(before, dump_order),
        how=reading(readings, "check"),
    )
    programs, worst = each(files, dump_order, output)
    found = [(file, finding) for file, program in programs for finding in program.lint(conditions)]
    _tell([file for file, _ in programs], found, output)
    failed = any(one.level == "error" for _, one in found) or (strict and bool(found))
    return max(worst, Exit.FAILURE if failed else Exit.OK)


def _limits(**limits: float) -> dict[str, Any]:
    for name, limit in limits.items():
        if not limit > 0:  # what is no number is neither
            raise RequestError(
                f"--{name.replace('_', '-')} {limit:g} is not possible", expected="a number above 0"
            )
    return limits


def _tell(judged: list[Path], found: list[tuple[Path, Finding]], output: Output) -> None:
    facts = [
        {
            "file": str(file),
            "rule": one.rule,
            "level": one.level,
            "step": one.step or None,
            "text": one.text,
            "reason": one.reason,
        }
        for file, one in found
    ]
    output.document("motorbus.stepper.check/1", {"files": [str(file) for file in judged], "findings": facts})
    if not found:
        output.text("no findings")
        return
    rows = [(file, one.step or "", one.rule, one.level, one.text, one.reason) for file, one in found]
    output.table("", ("file", ">step", "rule", "level", "what", "why"), rows)


def _before(path: Path | None, order: str) -> Project | None:
    """What project 1 holds. Raises RequestError for another project."""
    if path is None:
        return None
    project = loaded(path, order).project
    if project.number not in (0, 1):
        raise RequestError(
            f"{path}: --before holds project {project.number}",
            expected="project 1, whose step 1 jog, single move and homing run with",
        )
    return project


@app.command(
    help_epilogue="""What an operator takes at an input nobody knows: waits are counted. The
band is over the readings of the acceleration, of which the manual does not
say per what it is.

Examples:

    motorbus stepper estimate examples/pick_and_place.toml
    motorbus stepper estimate --ramp pulse examples/pick_and_place.toml""",
)
def estimate(*files: File, dump_order: DumpOrder = "little", output: Silent, **readings: Readings) -> Exit:
    """Say how long a program takes."""
    how = reading(readings, "estimate")
    programs, worst = each(files, dump_order, output)
    found = [(file, program, program.estimate(how)) for file, program in programs]
    facts = [
        {"file": str(file), "name": program.name, **one.data(), "text": str(one)}
        for file, program, one in found
    ]
    output.document("motorbus.stepper.estimate/1", {"estimates": facts})
    _lines(
        output, [(file, CLEARED if program.project.is_cleared else str(one)) for file, program, one in found]
    )
    return worst


@app.command(
    help_epilogue="""Examples:

    motorbus stepper order examples/pick_and_place.toml
    motorbus stepper order --seg-loop extra examples/pick_and_place.toml""",
)
def order(*files: File, dump_order: DumpOrder = "little", output: Silent, **readings: Readings) -> Exit:
    """Say in which order the steps of a program come, and how often."""
    how = reading(readings, "order")
    programs, worst = each(files, dump_order, output)
    plans = [(file, program.plan(how)) for file, program in programs]
    facts = [{"file": str(file), "order": list(one.order), "passes": one.passes} for file, one in plans]
    output.document("motorbus.stepper.order/1", {"programs": facts})
    _lines(output, [(file, _ordered(one)) for file, one in plans])
    return worst


def _ordered(plan: Plan) -> str:
    if not plan.order:
        return CLEARED
    return f"{' '.join(map(str, plan.order))}  {_passes(plan.passes)}"


def _passes(count: int | None) -> str:
    if count is None:
        return "(until it is stopped)"
    return "(once)" if count == 1 else f"({count} times)"


def _lines(output: Output, lines: list[tuple[Path, str]]) -> None:
    for file, text in lines:
        output.text(f"{file}: {text}" if len(lines) > 1 else text)
