"""`motorbus stepper show`: a program step by step, and its picture over time. Opens no port."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.parameters import Silent
from motorbus.cli.stepper.files import CLEARED, DumpOrder, File, Readings, app, each, reading, settler
from motorbus.cli.stepper.profiles import settled
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from motorbus.cli.output import Output
    from motorbus.families.stepper import Behaviour, Plan, Program
    from motorbus.families.stepper.program import StepPlan

_COLUMNS = (
    *(">step", ">times", ">units", ">pulses", ">Hz", "shape", ">motion s", ">pause s", "output", "waits for"),
    "ends at",
)
_LONGEST_WAIT = 1_000_000


@app.command(
    help_epilogue="""The picture shows position, speed, outputs and inputs over time, with an
operator who takes --wait seconds at each input; the suffix of its name says
of which kind it is (.png, .svg, .pdf). It needs matplotlib, and one program.
With --json each program is a line of its own.

Examples:

    motorbus stepper show examples/pick_and_place.toml
    motorbus stepper show examples/pick_and_place.toml --output feed.svg
    motorbus stepper show backup/project1.bin backup/project2.bin --json""",
)
def show(
    *files: File,
    output_: Path | None = None,
    wait: float = 1.0,
    passes: int = 1,
    dump_order: DumpOrder = "little",
    output: Silent,
    **readings: Readings,
) -> Exit:
    """Show what programs do, step by step, and draw one.

    Parameters
    ----------
    output_
        A picture to draw.
    wait
        s that an operator takes at each input, in the picture.
    passes
        How many passes of an endless program are drawn.
    """
    if not 0 <= wait <= _LONGEST_WAIT:
        raise RequestError(f"--wait {wait:g} is not possible", expected=f"0 to {_LONGEST_WAIT} s")
    if passes < 1:
        raise RequestError(f"--passes {passes} is not possible", expected="1 or more")
    if output_ is not None and len(files) > 1:
        raise RequestError(f"one picture of {len(files)} programs", expected="--output with one program")
    how, by = reading(readings, "show"), settler(readings)
    programs, worst = each(files, dump_order, output)
    for file, program in programs:
        if output_ is not None:
            _draw(program, how, output_, wait, passes)
        drawn = f"{output_}{_part(program, passes)}" if output_ else ""
        plan = program.plan(how)
        plan = replace(plan, estimate=settled(plan.estimate, by))
        _show(file, program, plan, output_, drawn, output)
    return worst


def _part(program: Program, passes: int) -> str:
    """How much of an endless program is drawn; "" of one that is drawn whole."""
    if not program.project.is_endless:
        return ""
    return f": {passes} pass{'es' if passes > 1 else ''} of an endless program"


def _show(file: Path, program: Program, plan: Plan, picture: Path | None, drawn: str, output: Output) -> None:
    facts = {"file": str(file), **{name: value for name, value in plan.data().items() if name != "schema"}}
    output.document("motorbus.stepper.plan/1", {**facts, "picture": str(picture) if picture else None})
    if not plan.order:
        output.text(f"{file}: {CLEARED}")
        return
    output.table(program.name or str(file), _COLUMNS, _rows(plan, program))
    net = (
        f"a pass ends {plan.net_units:+d} units from where it began"
        if plan.net_units
        else "a pass ends where it began"
    )
    output.text(f"{plan.estimate}\n{net}" + (f"\ndrawn: {drawn}" if drawn else ""))


def _rows(plan: Plan, program: Program) -> Iterator[tuple[object, ...]]:
    from motorbus.families.stepper.program.names import input_name, output_name

    for step in plan.steps:
        output = output_name(step.output, program.outputs) if step.output else ""
        waits, ends = (
            input_name(port, program.inputs) if port else "" for port in (step.start_input, step.stop_input)
        )
        yield (
            *(step.number, step.times, step.units, _pulses(step), f"{step.frequency:.6g}", step.shape),
            *(
                f"{step.motion:.3f}" if step.motion < inf else "no end",
                f"{step.delay:g}",
                output,
                waits,
                ends,
            ),
        )


def _pulses(step: StepPlan) -> str:
    fewest = min(step.runs)
    return str(step.sent) if fewest == step.sent else f"{fewest} to {step.sent}"


def _draw(program: Program, how: Behaviour, path: Path, wait: float, passes: int) -> None:
    from motorbus import plot

    picture = program.picture(how, wait=wait, passes=passes)
    spans = [plot.Span(*span) for span in picture.spans]
    with usable(path, "written"):
        plot.sequence(
            path,
            picture.times,
            picture.curves,
            picture.lanes,
            spans,
            title=program.name or path.stem,
            remark=f"predicted{_part(program, passes)}",
        )
