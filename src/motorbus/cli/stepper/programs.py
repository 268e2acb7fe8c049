"""`motorbus stepper check|estimate|order`: what a program does wrong, how long, in which order. Opens no port."""

from __future__ import annotations

from pathlib import Path

from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.parameters import Flag, Silent
from motorbus.cli.stepper.files import DumpOrder, File, Readings, app, loaded, reading
from motorbus.errors import RequestError
from motorbus.families.stepper import Conditions, Program


def _all(files: tuple[Path, ...], order: str) -> list[tuple[Path, Program]]:
    if not files:
        raise RequestError("no file is given", expected="one or more programs")
    return [(file, loaded(file, order)) for file in files]


@app.command(
    help_epilogue="""Ends with exit code 1 if any finding is an error, and with --strict if
there is any finding at all.

Examples:

    motorbus stepper check examples/pick_and_place.toml
    motorbus stepper check --unattended --highest 20000 *.toml""",
)
def check(
    *files: File,
    highest: float = 100_000.0,
    longest: float = 3600.0,
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
    homing
        Input 5 is used for homing.
    unattended
        Nobody is there to press a button.
    strict
        Any finding is a failure.
    """
    how = reading(readings)
    conditions = Conditions(highest=highest, longest=longest, homing=homing, unattended=unattended, how=how)
    found = [
        (file, finding) for file, program in _all(files, dump_order) for finding in program.lint(conditions)
    ]
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
    output.document("motorbus.stepper.check/1", {"files": [str(file) for file in files], "findings": facts})
    if found:
        rows = [(file, one.step or "", one.rule, one.level, one.text, one.reason) for file, one in found]
        output.table("", ("file", ">step", "rule", "level", "what", "why"), rows)
    else:
        output.text("no findings")
    failed = any(one.level == "error" for _, one in found) or (strict and bool(found))
    return Exit.FAILURE if failed else Exit.OK


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
    how = reading(readings)
    found = [(file, program, program.estimate(how)) for file, program in _all(files, dump_order)]
    facts = [
        {"file": str(file), "name": program.name, **one.data(), "text": str(one)}
        for file, program, one in found
    ]
    output.document("motorbus.stepper.estimate/1", {"estimates": facts})
    _lines(output, [(file, str(one)) for file, _, one in found])
    return Exit.OK


@app.command(
    help_epilogue="""Examples:

    motorbus stepper order examples/pick_and_place.toml
    motorbus stepper order --seg-loop extra examples/pick_and_place.toml""",
)
def order(*files: File, dump_order: DumpOrder = "little", output: Silent, **readings: Readings) -> Exit:
    """Say in which order the steps of a program come, and how often."""
    how = reading(readings)
    plans = [(file, program.plan(how)) for file, program in _all(files, dump_order)]
    facts = [{"file": str(file), "order": list(one.order), "passes": one.passes} for file, one in plans]
    output.document("motorbus.stepper.order/1", {"programs": facts})
    _lines(output, [(file, f"{' '.join(map(str, one.order))}  {_passes(one.passes)}") for file, one in plans])
    return Exit.OK


def _passes(count: int | None) -> str:
    if count is None:
        return "(until it is stopped)"
    return "(once)" if count == 1 else f"({count} times)"


def _lines(output: Output, lines: list[tuple[Path, str]]) -> None:
    for file, text in lines:
        output.text(f"{file}: {text}" if len(lines) > 1 else text)
