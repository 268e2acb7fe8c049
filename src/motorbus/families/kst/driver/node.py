"""What the driver knows of one servo: its id, how it is spoken to, when it last answered, what bounds its travel.

A node is memory only: no bus, no I/O. Driver functions fill it. Nothing here is ever guessed: unknown stays None.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import Any, Final

from motorbus.core.register import Register, RegisterMap, Value
from motorbus.core.request import Request
from motorbus.errors import RequestError
from motorbus.families.kst import wire
from motorbus.families.kst.driver.dialect import PLAIN, Dialect
from motorbus.families.kst.table import Profile, to_raw


class Node:
    """One servo by its id, 1 to 127, and what is known of it.

    `at` is the arrival of its last answer on the link's clock (s); `limits` its travel limits in rad as last read,
    None when not read yet. `unsaved` names the rows that were written here and are not known to have been saved.
    `last_move` identifies the move that was ordered last.
    `kept` are exchanges that bring one quantity, each with the id format (True: 29 bits) in which it asks.
    """

    def __init__(self, node: int, dialect: Dialect = PLAIN) -> None:
        self.node: Final = checked_id(node)
        self.dialect: Final = dialect
        self.limits: tuple[float, float] | None = None
        self.at = -inf
        self.unsaved: set[str] = set()
        self.last_move: object = None
        self.kept: Final[dict[str, tuple[bool, Request[Any]]]] = {}

    @property
    def profile(self) -> Profile:
        """The make it was said to be of; no servo tells."""
        return self.dialect.profile

    @property
    def table(self) -> RegisterMap:
        """Its objects, by its profile."""
        return self.dialect.profile.table

    @property
    def alarm(self) -> tuple[str, ...]:
        """Alarms that it sent within the few seconds before its last answer; it never says that one is over."""
        return self.dialect.alarm(self.node, self.at)

    def value(self, row: Register, raw: int) -> Value:
        """Raw value of an object -> value in the row's unit."""
        return row.to_value(raw)

    def raw(self, row: Register, value: Value) -> int:
        """Value in the row's unit -> raw value; half a count of an angle goes away from zero, as in decimal.

        Raises RequestError when it is not a finite number, or an angle outside the row's range.
        """
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RequestError(
                f"{row.name}: {value!r} is not a number",
                advice="give a number; nothing was sent",
                node=self.node,
            )
        try:
            return to_raw(self.profile, value, row.name) if row.unit == "rad" else row.to_raw(value)
        except OverflowError:
            raise RequestError(
                f"{row.name}: this number is far out of range",
                advice="give an angle inside the range; nothing was sent",
                node=self.node,
            ) from None


def checked_id(node: int) -> int:
    """An id that one servo can have. Raises RequestError for everything else, 0 (everyone) included."""
    if isinstance(node, int) and not isinstance(node, bool) and node in wire.NODES:
        return node
    raise RequestError(
        f"{node!r} is not the id of a servo" + (": 0 addresses everyone at once" if node == 0 else ""),
        expected="1 to 127",
        advice="name one servo; `motorbus scan BUS` lists them; nothing was sent",
    )


def checked_ids(nodes: Iterable[int]) -> list[int]:
    """Each once, in this order. Raises RequestError for what is no id."""
    return list(dict.fromkeys(checked_id(node) for node in nodes))


def hexadecimal(node: int) -> str:
    """A node as people of this protocol write it: 0x25 (37)."""
    return f"0x{node:02X} ({node})"
