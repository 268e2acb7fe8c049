"""`motorbus stepper convert|schema`: a program as file, dump or frames, and what a file may say. Opens no port."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.parameters import Silent
from motorbus.cli.stepper.files import DumpOrder, File, app, loaded
from motorbus.errors import RequestError
from motorbus.families.stepper import Program
from motorbus.families.stepper.table import Order, checked_order

KINDS: Final = ("toml", "dump", "image", "frames")


@app.command(
    help_epilogue="""toml is the file that people write; dump the 226 bytes that a controller
answers, image the 220 behind their head, both in hexadecimal, or as they are
in a file; frames the requests that write and save it, one on each line. What
a form cannot hold is told on stderr.

Examples:

    motorbus stepper convert examples/pick_and_place.toml --to frames
    motorbus stepper convert examples/pick_and_place.toml \\
        --to dump --output pick.bin
    motorbus stepper convert pick.bin > pick.toml""",
)
def convert(
    file: File,
    *,
    to: str = "toml",
    output_: Path | None = None,
    dump_order: DumpOrder = "little",
    output: Silent,
) -> Exit:
    """Turn a program into another form.

    Parameters
    ----------
    to
        toml, dump, image or frames
    output_
        A file to write; stdout when left out.
    """
    if to not in KINDS:
        raise RequestError(f"there is no form {to!r}", expected=f"one of {', '.join(KINDS)}")
    program = loaded(file, dump_order)
    text, data = _made(program, to, checked_order(dump_order))
    for lost in _lost(program, to):
        output.note(f"note: {lost}")
    if output_ is not None:
        with usable(output_, "written"):
            output_.write_bytes(data)
    facts = {"to": to, "file": str(output_) if output_ else None}
    output.document("motorbus.stepper.convert/1", {**facts, **({} if output_ else {to: text})})
    output.text(f"written: {output_}" if output_ else text)
    return Exit.OK


def _lost(program: Program, to: str) -> Iterator[str]:
    """What the program has and this form of it has not."""
    if to in ("dump", "image"):
        return
    found = {finding.rule: finding.text for finding in program.lint()}
    if "L18" in found:
        yield f"{to} cannot hold what no field names: {found['L18']}"
    if to == "frames" and "L20" in found:
        yield f"frames write no steps behind the last one: {found['L20']}"


def _made(program: Program, to: str, order: Order) -> tuple[str, bytes]:
    """The text of it, and what a file of it holds."""
    if to == "toml":
        text = program.text()
        return text.rstrip("\n"), text.encode()
    if to == "frames":
        text = "\n".join(frame.hex(" ").upper() for frame in program.frames())
        return text, (text + "\n").encode()
    data = program.dump(order) if to == "dump" else program.image(order)
    return data.hex(" ").upper(), data


@app.command(
    help_epilogue="""An editor that is given it completes fields and checks ranges as one writes.

Examples:

    motorbus stepper schema > stepper-program.schema.json""",
)
def schema(*, output: Silent) -> Exit:
    """Print the JSON Schema of a program file."""
    import json

    from motorbus.families.stepper.program import schema as made

    output.document("motorbus.stepper.schema/1", {"schema_of_files": made()})
    output.text(json.dumps(made(), indent=2, ensure_ascii=False))
    return Exit.OK
