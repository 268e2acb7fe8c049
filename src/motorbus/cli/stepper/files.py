"""What the commands of this family share: a program from a file of any kind, and how a controller is taken to be."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.output import Output
from motorbus.core.switches import options, switched
from motorbus.errors import RequestError
from motorbus.families.stepper import Behaviour, Program
from motorbus.families.stepper.table import checked_order

NAME: Final = "stepper"
LONGEST: Final = 1 << 20
CLEARED: Final = "no steps: the project has been cleared"

app = App(name=NAME, help="What only stepper controllers can do.", help_epilogue="")

File = Annotated[
    Path, Parameter(name="FILE", help="A program (.toml), or a dump: 226 or 220 bytes, or in hexadecimal.")
]
DumpOrder = Annotated[
    str,
    Parameter(
        help="Which byte of a number comes first in a dump: little (the lowest, an assumption) or big.",
    ),
]
Readings = Annotated[
    str,
    Parameter(
        help="How a question that the manual leaves open is taken: --ramp pulse, --rounding carry, --seg-loop extra "
        "and the other switches of the simulator that concern a run."
    ),
]


def loaded(path: Path, order: str = "little") -> Program:
    """The program in this file, a dump with this order of bytes.

    Raises RequestError, with the name of the file, for what cannot be.
    """
    first = checked_order(order)
    is_text = path.suffix.lower() == ".toml"
    with usable(path, "read"):
        data = path.read_bytes()
    if len(data) > LONGEST:
        raise RequestError(f"{path} has {len(data)} bytes", expected=f"{LONGEST} at most")
    try:
        if is_text:
            return Program.parse(data.decode())
        return Program.from_dump(data, name=path.stem, order=first)
    except UnicodeDecodeError as error:
        raise RequestError(f"{path} is no text: {error.reason}", expected="TOML in UTF-8") from None
    except RequestError as error:
        error.summary = f"{path}: {error.summary}"
        raise


def each(files: tuple[Path, ...], order: str, output: Output) -> tuple[list[tuple[Path, Program]], Exit]:
    """Every program that can be read; of each other one it is told at once why not, and the exit code is to be 2.

    Raises RequestError when there is none at all.
    """
    if not files:
        raise RequestError("no file is given", expected="one or more programs")
    checked_order(order)
    found: list[tuple[Path, Program]] = []
    errors: list[RequestError] = []
    for file in files:
        try:
            found.append((file, loaded(file, order)))
        except RequestError as error:
            errors.append(error)
    for told in errors if found else errors[:-1]:
        output.error(told)
    if not found:
        raise errors[-1]
    return found, Exit.USAGE if errors else Exit.OK


def reading(said: dict[str, str]) -> Behaviour:
    """How a controller is taken to be. Raises RequestError for a switch or a value that there is not."""
    known = {option.name for option in options(Behaviour)}
    given = {name.replace("-", "_"): value for name, value in said.items()}
    if unknown := sorted(given.keys() - known):
        raise RequestError(f"there is no --{unknown[0]}", expected=f"one of {', '.join(sorted(known))}")
    return switched(Behaviour, NAME, given)
