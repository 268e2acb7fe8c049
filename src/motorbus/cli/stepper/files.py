"""What the commands of this family share: a program from a file of any kind, and how a controller is taken to be."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.output import Output
from motorbus.core.switches import options, switched
from motorbus.errors import RequestError
from motorbus.families.stepper import Behaviour, Program
from motorbus.families.stepper.program.backups import is_backup
from motorbus.families.stepper.table import checked_order

NAME: Final = "stepper"
LONGEST: Final = 1 << 20
CLEARED: Final = "no steps: the project has been cleared"
_ORDER: Final = ("seg_loop", "proj_loop")
_TIME: Final = ("ramp", "ramp_tick_ms", "rounding", "zero_distance", *_ORDER)
_OUTPUTS: Final = ("output_zero", "outputs_on_stop")
CONCERNED: Final[Mapping[str, tuple[str, ...]]] = {
    "check": ("ramp", "ramp_tick_ms", "rounding", *_ORDER, *_OUTPUTS),
    "estimate": _TIME,
    "order": _ORDER,
    "show": (*_TIME, *_OUTPUTS, "start_input", "stop_input", "stop_input_scope"),
}
"""The switches that what a command says depends on. The others are taken too, and change nothing in it."""

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
        if is_text and is_backup(data.decode()):
            raise _backup(path) from None
        error.summary = f"{path}: {error.summary}"
        raise


def _backup(path: Path) -> RequestError:
    return RequestError(
        f"{path} is a backup of a controller, and no program",
        expected="a program (.toml), or a dump of one project",
        advice=f"`motorbus stepper restore {path} BUS --dry-run` shows what differs from it; nothing was sent",
    )


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


def reading(said: dict[str, str], command: str) -> Behaviour:
    """How a controller is taken to be, by the switches given to this command.

    Raises RequestError, with what the command has, for a flag that there is not, and for an impossible value.
    """
    known = {option.name for option in options(Behaviour)}
    given = {name.replace("-", "_"): value for name, value in said.items()}
    if unknown := sorted(given.keys() - known):
        raise _unknown(_flag(unknown[0]), command)
    return switched(Behaviour, NAME, given)


def _unknown(flag: str, command: str) -> RequestError:
    """The error for a flag that a command has not: flags as it are told first."""
    own = [
        name
        for argument in app[command].assemble_argument_collection()
        for name in argument.names
        if argument.parse and name.startswith("--") and "[" not in name
    ]
    switches = [_flag(name) for name in CONCERNED[command]]
    near = [name for name in own + switches if name.startswith(flag)] or get_close_matches(
        flag, own + switches, n=2
    )
    perhaps = f"perhaps {' or '.join(near)}; " if near else ""
    return RequestError(
        f"{command}: there is no {flag}",
        expected=f"{perhaps}one of {', '.join(own)}; or a switch: {', '.join(switches)}",
    )


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")
