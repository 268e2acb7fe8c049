"""The controller of a line, and what its driver remembers. It reports neither state nor position."""

from __future__ import annotations

from typing import Final

from motorbus.core.register import Register, RegisterMap, Value, shown
from motorbus.errors import RequestError
from motorbus.families.stepper.execution.ramp import TICK_MS
from motorbus.families.stepper.parameters import LEDS, OUTPUTS, TABLE, Order, Project, checked_order
from motorbus.families.stepper.protocol import MOTOR, ONLY, checked_motor


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
