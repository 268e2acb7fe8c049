"""The controller of a line, what its driver remembers, and one request for each command of the manual.

It reports neither state nor position. A reply has no checksum: its key is every byte that the request determines, so a
reply of another command, project, step or port is never accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import Parameter, Signature
from typing import Any, Final, TypeVar

from motorbus.core.register import Register, RegisterMap, Value, shown
from motorbus.core.request import Effect, Expected, Precondition, Priority, Request, Response
from motorbus.core.setpoint import Setpoint
from motorbus.errors import RequestError
from motorbus.families.stepper.execution.ramp import TICK_MS
from motorbus.families.stepper.parameters import LEDS, OUTPUTS, TABLE, Order, Project, allowed, checked_order
from motorbus.families.stepper.protocol import (
    COMMANDS,
    MOTOR,
    ONLY,
    Command,
    check,
    checked_motor,
    encode,
    expected_key,
)

T = TypeVar("T")

_PRIORITIES: Final = {
    Effect.NONE: Priority.POLL,
    Effect.PERSISTENT: Priority.CONFIGURATION,
    Effect.TORQUE: Priority.CONTROL,
    Effect.MOTION: Priority.CONTROL,
}
STOPS: Final = ("stop_project", "stop_motor")


class BusState:
    """What was read from and sent to the controller of one open bus. Other hosts, buttons and power cycles change it.

    `projects`   as they were read last; forgotten at an own write, a missing reply and a reconnect
    `selected`   the project that was selected last; None: not known
    `is_edited`  parameters were sent since the last save; they may be those of `projects` all the same
    `stops`      number of calls of `stop`; `stopped`: of acknowledged stops of a project
    `may_run`    a project was started; since then neither its notice came nor a stop was acknowledged
    `is_noted`   the journal has that start, and not its end
    `outputs`    the level last sent, by output 1 to 3 and 5 for the LEDs; None: unknown
    """

    def __init__(self) -> None:
        self.projects: dict[int, Project] = {}
        self.selected: int | None = None
        self.is_edited = False
        self.stops = self.stopped = 0
        self.may_run = self.is_noted = False
        self.outputs: dict[int, bool | None] = dict.fromkeys((*range(1, OUTPUTS + 1), LEDS))


class Node:
    """The one controller of a line, id 1; its frames carry no address. Raises RequestError for another id.

    `motor` is the number in motor commands, `order` the byte order in dumps, `tick_ms` that of ramps, `state` that of
    the open bus.
    """

    def __init__(
        self,
        node: int = ONLY,
        motor: int = MOTOR,
        order: Order = "little",
        tick_ms: float = TICK_MS,
        state: BusState | None = None,
    ) -> None:
        if not isinstance(node, int) or isinstance(node, bool) or node != ONLY:
            raise RequestError(
                f"{shown(node)} is not the id of a stepper controller",
                expected=f"{ONLY}: a line has one controller, whose frames carry no address",
                advice="open a line for each controller",
            )
        self.node: Final = node
        self.motor: Final = checked_motor(motor)
        self.order: Final[Order] = checked_order(order)
        self.tick_ms: Final = tick_ms
        self.state: Final = BusState() if state is None else state

    @property
    def alarm(self) -> tuple[str, ...]:
        """Always empty: the protocol reports no errors."""
        return ()

    @property
    def table(self) -> RegisterMap:
        """The parameters of one project."""
        return TABLE

    def raw(self, row: Register, value: Value) -> int:
        """Value in the unit of the row -> raw value. Raises RequestError if it is not a finite number."""
        return row.to_raw(value)


# -- requests --------------------------------------------------------------------------------------------------------


def ignore(reply: bytes) -> None:
    """The value of an acknowledgement: it carries none."""


def command(
    node: Node,
    name: str,
    decode: Callable[[bytes], T],
    *,
    setpoints: tuple[Setpoint, ...] = (),
    precondition: Precondition | None = None,
    expert: bool = False,
    **values: int,
) -> Request[T]:
    """A command by its name in `COMMANDS`; `decode` gets its reply, 6 bytes or the 226 of a dump.

    `setpoints` are what a motion asks, for the gate. `expert` lets a step use inputs 3 and 4. Raises RequestError,
    naming the field and its range, for a number that may not be sent.
    """
    row = COMMANDS[name]
    check(name, values, expert=expert)
    wire = encode(name, motor=node.motor, **values)

    def take(answer: Response) -> T:
        _remember(node.state, row, values)
        return decode(answer.replies[0].data)

    return Request(
        wire,
        (Expected(node.node, expected_key(wire), row.reply_length),),
        take,
        priority=Priority.STOP if name in STOPS else _PRIORITIES[row.effect],
        effect=row.effect,
        setpoints=setpoints,
        reply_within=row.reply_within,
        repeatable=row.repeatable,
        precondition=precondition,
    )


def _remember(state: BusState, row: Command, values: Mapping[str, int]) -> None:
    """Remember what an acknowledged command has changed."""
    if row.name == "stop_project":
        state.stopped += 1
        state.may_run = False
    if row.effect is not Effect.PERSISTENT:
        return
    state.projects.clear()
    if row.name == "select_project":
        state.selected = values["project"]
    if row.is_edit or values["project"] == state.selected:
        state.is_edited = row.is_edit


def check_selected(node: Node, project: int) -> None:
    """Raise RequestError unless this project was selected last: a save stores the selected one, whatever it names."""
    selected = node.state.selected
    if selected != project:
        known = "no project was selected here" if selected is None else f"project {selected} is selected"
        raise RequestError(
            f"save_project({project}) would store another project: {known}",
            advice=f"call select_project({project}, STEPS) and edit it, or use write()",
            node=node.node,
        )


def manual(name: str) -> Callable[..., Request[None]]:
    """The driver function of one command of the manual: its signature and docstring come from the row."""
    row = COMMANDS[name]
    fields = sorted(row.fields, key=lambda field: field != "step")
    parameters = [Parameter(field, Parameter.POSITIONAL_OR_KEYWORD, annotation="int") for field in fields]
    node = Parameter("node", Parameter.POSITIONAL_ONLY, annotation="Node")
    signature = Signature([node, *parameters], return_annotation="Request[None]")

    def function(node: Node, /, *args: int, **kwargs: int) -> Request[None]:
        values: dict[str, Any] = signature.bind(node, *args, **kwargs).arguments
        del values["node"]
        request = command(node, name, ignore, **values)
        if name == "save_project":
            check_selected(node, values["project"])
        return request

    function.__name__ = function.__qualname__ = name
    function.__doc__ = _docstring(row, fields)
    function.__signature__ = signature  # type: ignore[attr-defined]
    return function


def _docstring(row: Command, fields: list[str]) -> str:
    lines = [f"{row.title} (item {row.number})."]
    lines += [f"`{field}`: {allowed(field)}." for field in fields]
    if row.note:
        lines.append(f"{row.note[0].upper()}{row.note[1:]}.")
    if row.is_edit and row.name != "select_project":
        lines.append(
            "It edits the selected project; it is not read back, and power-off loses it until a save."
        )
    if fields:
        lines.append("Raises RequestError for a number out of range.")
    return "\n\n".join(lines)
