"""A volley in two halves: goals and question leave, and whoever let them go does something else until the answer is in.

A control loop that has been told its next goals before the answer to the last question is in wastes no time on the
wire. Only what goes straight can be halved so; whatever is otherwise is over when it has been let loose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from motorbus.bus.straight import land, loose
from motorbus.bus.volley import rides, volley
from motorbus.core.operation import Exchange
from motorbus.errors import LinkError

if TYPE_CHECKING:
    from motorbus.bus.course import Course
    from motorbus.bus.pump import Bus

Forgiven = tuple[type[Exception], ...]


class Loosed:
    """What has left as a volley does, in one write; `land` gives what came of it.

    Between the two the bus is free for everybody. Making one raises what `volley` does.
    """

    __slots__ = ("_bus", "_course", "_forgiven", "_told")

    def __init__(self, bus: Bus, exchanges: Sequence[Exchange[Any]], forgiven: Forgiven = ()) -> None:
        self._bus = bus
        self._forgiven = forgiven
        self._told: list[Any] = [None] * (len(exchanges) - 1)  # nothing comes of an order that is sure
        self._course: Course | None = _gone(bus, exchanges)
        if self._course is None:
            self._told = volley(bus, exchanges, forgiven)

    def land(self) -> list[Any]:
        """The value of each, or the error where it is forgiven. Waits for the answer. Raises the error that is not."""
        course, self._course = self._course, None
        if course is not None:
            try:
                self._told.append(land(self._bus, course))
            except LinkError:
                raise
            except self._forgiven as error:
                self._told.append(error)
        return self._told


def _gone(bus: Bus, exchanges: Sequence[Exchange[Any]]) -> Course | None:
    """The question of these, in the air, with the order ahead of it if there is one; None when nothing has left."""
    if not 1 <= len(exchanges) <= 2:
        return None
    *orders, question = exchanges
    if question.whole is None or not all(rides(order) for order in orders):
        return None
    return loose(bus, question, orders[0] if orders else None)
