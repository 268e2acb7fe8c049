"""The one controller of a line, as far as a host can know it: which motor it has, and how its projects are told.

There is no address in its frames, so there is one of them on a line, and it is called 1. The motor's number, which
does stand in its frames, is another thing: the manual has 3 in all of them.
"""

from __future__ import annotations

from typing import Final

from motorbus.core import units
from motorbus.core.register import Register, RegisterMap, Value
from motorbus.core.request import Request
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.memory import Memory
from motorbus.families.stepper.table import TABLE, Order, checked_order


class Node:
    """The controller of a line. Raises RequestError for another id.

    `motor` is the number that motor commands name, `order` says which byte of a number comes first in its dumps,
    `memory` is what was said to it on this bus, `kept` are the exchanges that read its inputs, by port.
    """

    def __init__(
        self,
        node: int = wire.ONLY,
        motor: int = wire.MOTOR,
        order: Order = "little",
        memory: Memory | None = None,
    ) -> None:
        self.node: Final = checked_id(node)
        self.motor: Final = checked_motor(motor)
        self.order: Final[Order] = checked_order(order)
        self.memory: Final = memory if memory is not None else Memory()
        self.kept: Final[dict[int, Request[bool]]] = {}

    @property
    def alarm(self) -> tuple[str, ...]:
        """Always empty: the protocol has no word for an error."""
        return ()

    @property
    def table(self) -> RegisterMap:
        """The parameters of one project."""
        return TABLE

    def value(self, row: Register, raw: int) -> Value:
        """Raw value of a parameter -> value in the row's unit."""
        return row.to_value(raw)

    def raw(self, row: Register, value: Value) -> int:
        """Value in the row's unit -> raw value. Raises RequestError when it is not a finite number."""
        return row.to_raw(value)


def checked_id(node: int) -> int:
    """The id of the only controller. Raises RequestError for every other one."""
    if isinstance(node, int) and not isinstance(node, bool) and node == wire.ONLY:
        return node
    raise RequestError(
        f"{node!r} is not the id of a stepper controller",
        expected=f"{wire.ONLY}: there is one of them on a line",
        cause="its frames carry no address",
        advice="open a line for each of them; nothing was sent",
    )


def checked_motor(number: object) -> int:
    """The number of a motor, also as text. Raises RequestError for one that no frame can name."""
    try:
        found = units.whole(str(number))
    except ValueError:
        found = 0
    if found not in wire.MOTORS:
        raise RequestError(
            f"motor={number} is not the number of a motor",
            expected="1 to 255, not ending in E in hex; the manual knows 3 only",
        )
    return found
