"""The commands of the manual that are one frame and no more: those that set parameters, and the two that stop.

They differ in their numbers only, so each is made of its row in the tables: its flags, what they take, and its help.
What takes more than a frame to be safe, as whatever moves the motor, has a function of its own in the other files.
"""

from __future__ import annotations

from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import Parameter as Said

from motorbus.cli.exits import Exit
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.stepper.controller import BusName, BusOption, carried_out, unless_lent, verb
from motorbus.cli.stepper.files import app
from motorbus.cli.stepper.numbers import expected, number
from motorbus.families.stepper.driver import Node, commands
from motorbus.families.stepper.table import EDITS, ORDERS, PARAMETERS, check, checked_project

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motorbus.cli.output import Output

EXAMPLES: Final[Mapping[str, str]] = {
    "set_microstep_and_angle": "--microsteps 8 --step-angle 1.8deg",
    "set_turn_distance": "--turn-distance 1600",
    "set_step_distance": "--step 1 --distance 10",
    "set_step_direction_start": "--step 1 --direction reverse --start-frequency 50",
    "set_step_accel_speed": "--step 1 --acceleration 30 --speed 100rpm",
    "set_step_output": "--step 1 --output 4",
    "set_step_delay": "--step 1 --delay 500ms",
    "set_step_start_input": "--step 1 --start-input 2",
    "set_step_stop_input": "--step 1 --stop-input none",
    "set_segment_loop": "--loop-first 1 --loop-last 1 --loop-count 3",
    "set_project_loop": "--project-loop endless",
    "set_stop_mode": "--stop-mode immediate",
    "set_mode4": "--mode4 0 --yes",
    "set_power_on_home": "--power-on-home off --yes",
}
"""Of each command that sets parameters: what its help shows."""
_EDITS: Final = tuple(name for name in EDITS if name != "select_project")
_STOPS: Final = ("stop_project", "stop_motor")
_SELECTED: Final = """Plain numbers are those of the manual; some may have a unit: 500ms, 100rpm.

It goes to the project that is selected, which nobody can ask; --project
selects it first, keeping its number of steps, and that loads what is stored of
it, or so it is assumed: what was set before and not saved is lost then. So
select a project once (`select-project`), set what there is to set, read it
(`read-project`), save it (`save-project`). `write` does all that, verified."""
_BOTH: Final = "`motorbus stop` says both stops, each until it is accepted."
_EXPLAINED: Final = """{note}{more}

Examples:

{examples}"""
_WIDTH: Final = 70


def words(name: str) -> str:
    """set_step_delay -> set-step-delay, as commands and flags are called."""
    return name.replace("_", "-")


def _edit(
    name: str,
    bus: str,
    output: Output,
    options: Mapping[str, str],
    *,
    project: int | None,
    yes: bool,
    dry_run: bool,
    **texts: str,
) -> Exit:
    values = {field.removesuffix("_"): number(field.removesuffix("_"), text) for field, text in texts.items()}
    check(name, values)
    if project is not None:
        checked_project(project)
    order = ORDERS[name]
    guarded = any(PARAMETERS[field].protected for field in values)
    carried_out(
        bus,
        options,
        output,
        lambda one: unless_lent(one, name, _selected_first(name, project, values, one)),
        consent=f"{order.title.lower()}: {order.note}" if guarded and not yes else "",
        dry_run=dry_run,
    )
    if not dry_run:
        facts = {"project": project, **values, "accepted": True, "kept": False}
        output.document(f"motorbus.stepper.{words(name)}/1", facts)
        where = f"project {project}" if project else "the selected project, whichever that is"
        said = ", ".join(f"{field} {raw}" for field, raw in values.items())
        output.text(f"accepted for {where}: {said}; lost with the supply unless it is saved")
    return Exit.OK


async def _selected_first(name: str, project: int | None, values: Mapping[str, int], one: Node) -> None:
    if project is not None:
        await verb("select", project)(one)  # type: ignore[arg-type]
    await getattr(commands, name)(one, **values)


def _stop(name: str, bus: str, output: Output, options: Mapping[str, str], *, dry_run: bool) -> Exit:
    carried_out(bus, options, output, getattr(commands, name), dry_run=dry_run)
    if not dry_run:
        output.document(f"motorbus.stepper.{words(name)}/1", {"accepted": True})
        output.text(
            "accepted: whether it slows down or ends at once is its stop mode, and nothing tells when it rests"
        )
    return Exit.OK


_FIRST: Final = (Parameter("bus", Parameter.POSITIONAL_ONLY, annotation=BusName),)
_LAST: Final = (
    Parameter("dry_run", Parameter.KEYWORD_ONLY, default=False, annotation=DryRun),
    Parameter("output", Parameter.KEYWORD_ONLY, annotation=Silent),
    Parameter("options", Parameter.VAR_KEYWORD, annotation=BusOption),
)
_SELECT: Final = Parameter(
    "project",
    Parameter.KEYWORD_ONLY,
    default=None,
    annotation=Annotated[
        int | None, Said(help="Select this project first, 1 to 4; what is stored of it is loaded.")
    ],
)
_YES: Final = Parameter(
    "yes", Parameter.KEYWORD_ONLY, default=False, annotation=Annotated[Flag, Said(help="Do not ask before.")]
)


def _field(name: str) -> Parameter:
    """A flag for a number of the request; the flag --output has an underscore that the parser does not show."""
    said = Annotated[str, Said(help=f"{expected(name)}.")]
    return Parameter("output_" if name == "output" else name, Parameter.KEYWORD_ONLY, annotation=said)


def _parameters(name: str) -> tuple[Parameter, ...]:
    fields = sorted((place.name for place in ORDERS[name].command.places), key=lambda field: field != "step")
    own = (*map(_field, fields), _SELECT, _YES) if name in _EDITS else ()
    return (*_FIRST, *own, *_LAST)


def _registered(name: str, do: Callable[..., Exit]) -> None:
    """Make a command of the row of this name, and tell the parser of it."""

    parameters = _parameters(name)
    known = {one.name for one in parameters}
    usual = {one.name: one.default for one in parameters if one.default is not Parameter.empty}

    def command(bus: str, /, output: Output, **said: Any) -> Exit:
        options = {flag: text for flag, text in said.items() if flag not in known}
        own = {flag: value for flag, value in said.items() if flag in known}
        return do(name, bus, output, options, **{**usual, **own})

    command.__name__ = name
    command.__doc__ = f"{ORDERS[name].title} (item {ORDERS[name].command.number} of the manual)."
    command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {one.name: one.annotation for one in parameters}
    usage = f"Usage: motorbus stepper {words(name)} BUS{_flags(parameters)} [OPTIONS]"
    app.command(command, name=words(name), usage=usage, help_epilogue=_help(name))


def _flags(parameters: tuple[Parameter, ...]) -> str:
    """Those that must be said."""
    fields = [one for one in parameters if one.kind is one.KEYWORD_ONLY and one.default is one.empty]
    names = [one.name.strip("_") for one in fields if one.annotation is not Silent]
    return "".join(f" --{words(name)} N" for name in names)


def _help(name: str) -> str:
    order, start = ORDERS[name], f"    motorbus stepper {words(name)} stepper:"
    if name in _STOPS:
        shown, more = [f"{start}/dev/ttyUSB0", f"{start}sim"], _BOTH
    else:
        own = EXAMPLES[name]
        between = " " if len(start) + len(own) < _WIDTH else " \\\n        "
        shown = [f"{start}sim{between}{own}", f"{start}/dev/ttyUSB0 \\\n        {own} --project 2"]
        more = _SELECTED
    note = f"{order.note.capitalize()}.\n" if order.note else ""
    return _EXPLAINED.format(note=note, more=more, examples="\n".join(shown))


for _name in _EDITS:
    _registered(_name, _edit)
for _name in _STOPS:
    _registered(_name, _stop)
