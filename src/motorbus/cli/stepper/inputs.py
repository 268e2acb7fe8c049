"""`motorbus stepper inputs|read-input|outputs|set-output`: what goes into the controller, and what comes out of it.

An input is the only thing that a controller tells while it runs. An output tells nothing: what is shown of it is what
was commanded here, and another program, a button or a step may switch it without a word.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Silent
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, numbers_in, verb
from motorbus.cli.stepper.files import app
from motorbus.cli.stepper.numbers import number
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.families.stepper.driver import Node
from motorbus.families.stepper.driver import inputs as reading
from motorbus.families.stepper.driver import outputs as switching
from motorbus.families.stepper.table import OutputPort, check

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.cli.output import Bar, Output

_WORDS: Final = {True: "active", False: "inactive", None: "not known"}
_PORTS: Final = {"all": int(OutputPort.ALL), "leds": int(OutputPort.LEDS)}
Port = Annotated[str, Parameter(name="PORT=LEVEL", help="1, 2, 3, all or leds; on or off: as 1=on leds=off")]


@app.command(
    usage="Usage: motorbus stepper inputs BUS [OPTIONS]",
    help_epilogue="""Each level is read until two readings in a row agree, for a reading has no
checksum and contacts bounce. With --seconds they are read in turn for so long,
and each change is told; what is over within two rounds is not seen, and the
rate that was reached is told in the end: 56 rounds per second for one input,
11 for all five, at most.

Examples:

    motorbus stepper inputs stepper:/dev/ttyUSB0
    motorbus stepper inputs stepper:/dev/ttyUSB0 --ports 1,2 --seconds 30
    motorbus stepper inputs stepper:sim --ports 5 --seconds 1 --json""",
)
def inputs(
    bus: BusName, /, *, ports: str = "1-5", seconds: str = "", output: Silent, **options: BusOption
) -> Exit:
    """Read the inputs of a controller, or watch them.

    Parameters
    ----------
    ports
        Which inputs, as 1,2 or 1-5.
    seconds
        Watch for so long, in s or as 2min.
    """
    chosen = numbers_in(ports)
    if seconds:
        return _watched(bus, chosen, units.parse(seconds, "time"), options, output)
    levels: Mapping[int, bool] = carried_out(bus, options, output, verb("inputs", chosen)) or {}
    _show(levels, output, "motorbus.stepper.inputs/1", "inputs")
    return Exit.OK


def _watched(
    bus: str, ports: tuple[int, ...], seconds: float, options: Mapping[str, str], output: Output
) -> Exit:
    def hear(event: object, bar: Bar) -> None:
        if isinstance(event, reading.InputChanged):
            output.document("motorbus.stepper.input/1", event._asdict())
            output.text(f"{event.at:.3f} s: input {event.port} {_WORDS[event.active]}")

    told: reading.Watched | None = carried_out(
        bus, options, output, verb("watch_inputs", ports, seconds), what="watching", hear=hear
    )
    if told is not None:
        levels = {str(port): active for port, active in told.levels.items()}
        facts = {"inputs": levels, "rounds": told.rounds, "seconds": told.seconds, "rate": told.rate}
        output.document("motorbus.stepper.inputs/1", {**facts, "changes": len(told.changes)})
        output.text(f"{len(told.changes)} changes; each input was read {told.rate:.1f} times a second")
    return Exit.OK


@app.command(
    usage="Usage: motorbus stepper read-input BUS --port PORT [OPTIONS]",
    help_epilogue="""One frame; `inputs` reads until two readings agree.

Examples:

    motorbus stepper read-input stepper:/dev/ttyUSB0 --port 5
    motorbus stepper read-input stepper:sim --port 1 --json""",
)
def read_input(bus: BusName, /, *, port: int, output: Silent, **options: BusOption) -> Exit:
    """Read an input once (item 24 of the manual).

    Parameters
    ----------
    port
        1 to 5; 3 starts and 4 stops a project, 5 is the home switch.
    """
    active = carried_out(bus, options, output, verb("read_input", port))
    output.document("motorbus.stepper.read-input/1", {"port": port, "active": active})
    output.text(f"input {port} is {_WORDS[active]}")
    return Exit.OK


@app.command(
    usage="Usage: motorbus stepper set-output BUS --port PORT --level on|off [OPTIONS]",
    help_epilogue="""What hangs on an output is not known here: it may be a brake, a valve or a
gripper. That the command was heard is acknowledged; how an output is then, no
controller tells.

Examples:

    motorbus stepper set-output stepper:/dev/ttyUSB0 --port 1 --level on
    motorbus stepper set-output stepper:sim --port leds --level on
    motorbus stepper set-output stepper:sim --port all --level off --dry-run""",
)
def set_output(
    bus: BusName,
    /,
    *,
    port: str,
    level: str,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Switch an output (item 23 of the manual).

    Parameters
    ----------
    port
        1, 2 or 3; 4 or all: all three; 5 or leds: both LEDs.
    level
        on (1, active: pulled low) or off (0).
    """
    return _switched("set-output", bus, (f"{port}={level}",), options, output, dry_run=dry_run)


@app.command(
    usage="Usage: motorbus stepper outputs BUS PORT=LEVEL... [OPTIONS]",
    help_epilogue="""One frame for each, in this order. No controller tells how its outputs are, so
there is nothing to read.

Examples:

    motorbus stepper outputs stepper:/dev/ttyUSB0 all=off 2=on
    motorbus stepper outputs stepper:sim 1=on leds=off""",
)
def outputs(
    bus: BusName, /, *levels: Port, dry_run: DryRun = False, output: Silent, **options: BusOption
) -> Exit:
    """Switch several outputs, one after the other."""
    return _switched("outputs", bus, levels, options, output, dry_run=dry_run)


def _switched(
    name: str,
    bus: str,
    levels: tuple[str, ...],
    options: Mapping[str, str],
    output: Output,
    *,
    dry_run: bool,
) -> Exit:
    wanted = [_level(text) for text in levels]
    if not wanted:
        raise RequestError(
            "which output, and how? No controller tells how its outputs are",
            expected="PORT=LEVEL, as 1=on",
            advice="nothing was sent",
        )
    told = carried_out(bus, options, output, partial(_each, wanted), dry_run=dry_run)
    if told is not None:
        _show(told, output, f"motorbus.stepper.{name}/1", "last_commanded")
    return Exit.OK


async def _each(wanted: list[tuple[int, int]], one: Node) -> dict[int, bool | None]:
    for port, level in wanted:
        await switching.set_output(one, port, bool(level))
    return switching.last_commanded(one)


def _level(text: str) -> tuple[int, int]:
    port, _, level = text.partition("=")
    wanted = _PORTS.get(port.casefold()) or number("port", port), number("level", level)
    check("set_output", dict(zip(("port", "level"), wanted, strict=True)))
    return wanted


def _show(levels: Mapping[int, bool | None], output: Output, schema: str, name: str) -> None:
    output.document(schema, {name: {str(port): active for port, active in levels.items()}})
    title = name.replace("_", " ")
    said = {int(OutputPort.LEDS): "LEDs"} if name == "last_commanded" else {}
    rows = [(said.get(port, port), _WORDS[active]) for port, active in levels.items()]
    output.table(title.capitalize(), [title.split()[-1].rstrip("s"), "level"], rows)
