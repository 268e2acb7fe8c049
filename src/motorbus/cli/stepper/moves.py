"""`motorbus stepper jog-forward|jog-reverse|run-once|home`: what the manual lets the motor do by hand, each bounded.

They have their speed from step 1 of project 1. `motorbus jog` and `motorbus move` choose one, and put back what was
there.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from motorbus.cli.consent import FAR
from motorbus.cli.exits import Exit
from motorbus.cli.home import homed
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.plain import plain
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, ours, verb
from motorbus.cli.stepper.files import app
from motorbus.cli.target import face
from motorbus.core import units
from motorbus.families.stepper.driver.goals import of_move

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output

_JOG = """With the speed of step 1 of project 1, and endless for the controller: this
program ends it after --seconds, also on Ctrl-C, but if it is killed the motor
goes on. `motorbus jog` has no such end. A way of more than 180 degrees needs
--yes.
"""
Seconds = Annotated[str, Parameter(name="--seconds", help="How long, in s or as 500ms.")]


@app.command(
    usage="Usage: motorbus stepper jog-forward BUS --seconds SECONDS [OPTIONS]",
    help_epilogue=f"""{_JOG}
Examples:

    motorbus stepper jog-forward stepper:/dev/ttyUSB0 --seconds 0.2
    motorbus stepper jog-forward stepper:sim --seconds 2s --yes""",
)
def jog_forward(
    bus: BusName,
    /,
    *,
    seconds: Seconds,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Turn forward for a time, then stop (item 18 of the manual).

    Parameters
    ----------
    yes
        Do not ask before a way of more than 180 degrees.
    """
    return _jogged("jog_forward", bus, seconds, options, output, yes=yes, dry_run=dry_run)


@app.command(
    usage="Usage: motorbus stepper jog-reverse BUS --seconds SECONDS [OPTIONS]",
    help_epilogue=f"""{_JOG}
Examples:

    motorbus stepper jog-reverse stepper:/dev/ttyUSB0 --seconds 0.2
    motorbus stepper jog-reverse stepper:sim --seconds 2s --yes""",
)
def jog_reverse(
    bus: BusName,
    /,
    *,
    seconds: Seconds,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Turn in reverse for a time, then stop (item 17b of the manual).

    Parameters
    ----------
    yes
        Do not ask before a way of more than 180 degrees.
    """
    return _jogged("jog_reverse", bus, seconds, options, output, yes=yes, dry_run=dry_run)


def _jogged(
    name: str,
    bus: str,
    seconds: str,
    options: Mapping[str, str],
    output: Output,
    *,
    yes: bool,
    dry_run: bool,
) -> Exit:
    span = units.parse(seconds, "time")
    do, question = verb(name, span), partial(_jog_question, name, span)
    told = carried_out(bus, options, output, do, consent="" if yes else question, dry_run=dry_run)
    if not dry_run:
        _show(name, told, output)
    return Exit.OK


def _jog_question(name: str, span: float, bus: Bus) -> str:
    way = abs(float(face(bus, 1).read("step_1_speed")["step_1_speed"]) * span)
    return f"{name.replace('_', ' ')} by {units.show(way, 'position')}" if way > FAR else ""


@app.command(
    usage="Usage: motorbus stepper run-once BUS [OPTIONS]",
    help_epilogue="""Distance, direction and speed are those of step 1 of project 1. `motorbus move
BUS#1+=ANGLE` goes by another one. No message comes at its end: how long it
takes is reckoned. A way of more than 180 degrees needs --yes.

Examples:

    motorbus stepper run-once stepper:/dev/ttyUSB0
    motorbus stepper run-once stepper:sim --yes
    motorbus stepper run-once stepper:sim --dry-run""",
)
def run_once(
    bus: BusName,
    /,
    *,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Run one move (item 19 of the manual).

    Parameters
    ----------
    yes
        Do not ask before a way of more than 180 degrees.
    """
    question = "" if yes else _move_question
    told = carried_out(bus, options, output, verb("run_once"), consent=question, dry_run=dry_run)
    if not dry_run:
        _show("run_once", told, output)
    return Exit.OK


def _move_question(bus: Bus) -> str:
    one = face(bus, 1)
    goal, *_ = of_move(one, one.read_project(1).project)
    return "" if abs(goal.value) <= FAR else f"move by {units.show(goal.value, 'position')}"


def _show(name: str, told: Any, output: Output) -> None:
    output.document(f"motorbus.stepper.{name.replace('_', '-')}/1", {"result": plain(told)})
    output.text(str(told))


@app.command(
    usage="Usage: motorbus stepper home BUS [OPTIONS]",
    help_epilogue="""The same as `motorbus home BUS`. If this program is killed, the controller goes
on homing.

Examples:

    motorbus stepper home stepper:/dev/ttyUSB0
    motorbus stepper home stepper:sim,home_switch=wired --deadline 20s --yes""",
)
def home(
    bus: BusName,
    /,
    *,
    deadline: str = "",
    velocity: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: BusOption,
) -> Exit:
    """Go in reverse until input 5, bounded in time (item 22 of the manual).

    Parameters
    ----------
    deadline
        How long it may take, as 20s.
    velocity
        How fast, in rad/s or as 30rpm; that of step 1 of project 1 when left out.
    yes
        Do not ask before.
    """
    return homed(f"{ours(bus)}#1", deadline, velocity, options, output, yes=yes, dry_run=dry_run)
