"""`motorbus stepper show`: a program step by step. Opens no port."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.parameters import Silent
from motorbus.cli.stepper.files import CLEARED, DumpOrder, File, Readings, app, each, reading

if TYPE_CHECKING:
    from collections.abc import Iterator

    from motorbus.cli.output import Output
    from motorbus.families.stepper import Plan, Program
    from motorbus.families.stepper.program import StepPlan

_COLUMNS = (
    *(">step", ">times", ">units", ">pulses", ">Hz", "shape", ">motion s", ">pause s", "output", "waits for"),
    "ends at",
)


@app.command(
    help_epilogue="""With --json each program is a line of its own.

Examples:

    motorbus stepper show examples/pick_and_place.toml
    motorbus stepper show backup/project1.bin backup/project2.bin --json""",
)
def show(
    *files: File,
    dump_order: DumpOrder = "little",
    output: Silent,
    **readings: Readings,
) -> Exit:
    """Show what programs do, step by step."""
    how = reading(readings, "show")
    programs, worst = each(files, dump_order, output)
    for file, program in programs:
        _show(file, program, program.plan(how), output)
    return worst


def _show(file: Path, program: Program, plan: Plan, output: Output) -> None:
    facts = {"file": str(file), **{name: value for name, value in plan.data().items() if name != "schema"}}
    output.document("motorbus.stepper.plan/1", facts)
    if not plan.order:
        output.text(f"{file}: {CLEARED}")
        return
    output.table(program.name or str(file), _COLUMNS, _rows(plan, program))
    net = (
        f"a pass ends {plan.net_units:+d} units from where it began"
        if plan.net_units
        else "a pass ends where it began"
    )
    output.text(f"{plan.estimate}\n{net}")


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
