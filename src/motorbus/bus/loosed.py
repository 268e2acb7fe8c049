"""A volley in two halves: goals and question leave, and whoever let them go does something else until the answer is in.

A control loop that knows its next goals before the answer to the last question is in wastes no time on the wire: they
leave `Behind` that answer, before anything else is done. Only what goes straight can be halved so; whatever is
otherwise is over when it has been let loose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from motorbus.bus.straight import foreseen, land, loose
from motorbus.bus.volley import rides, volley
from motorbus.core.operation import Exchange
from motorbus.errors import LinkError

if TYPE_CHECKING:
    from motorbus.bus.course import Course
    from motorbus.bus.pump import Bus

Forgiven = tuple[type[Exception], ...]


class Behind:
    """An order that may leave right behind an answer, with the same question again.

    Not before `begins` (s on the link's clock), and only if that answer `fits`, which is asked of what it means. It was
    judged when it was made, by what was known then. `at` is when it has left, None where it has not; its `course` is
    that of the question.
    """

    __slots__ = ("at", "begins", "course", "fits", "order")

    def __init__(self, order: Exchange[Any], begins: float, fits: Callable[[Any], bool]) -> None:
        self.order = order
        self.begins = begins
        self.fits = fits
        self.at: float | None = None
        self.course: Course | None = None


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

    def behind(
        self, orders: Sequence[Exchange[Any]], begins: float, fits: Callable[[Any], bool]
    ) -> Behind | None:
        """These, ready to leave right behind the answer; None where they cannot, or it is not sure that they may."""
        if self._course is None or len(orders) != 1 or not rides(orders[0]):
            return None
        return Behind(orders[0], begins, fits) if foreseen(self._bus, orders[0]) else None

    def land(self, behind: Behind | None = None) -> list[Any]:
        """The value of each, or the error where it is forgiven. Waits for the answer. Raises the error that is not.

        Where something has left `behind` it, that is what lands here next.
        """
        course, told = self._course, self._told
        if course is None:
            return told
        self._course = None
        try:
            told = [*told, land(self._bus, course, behind)]
        except LinkError:
            raise
        except self._forgiven as error:
            return [*told, error]
        if behind is not None and behind.course is not None:
            self._course, self._told = behind.course, [None]
        return told


def _gone(bus: Bus, exchanges: Sequence[Exchange[Any]]) -> Course | None:
    """The question of these, in the air, with the order ahead of it if there is one; None when nothing has left."""
    if not 1 <= len(exchanges) <= 2:
        return None
    *orders, question = exchanges
    if question.whole is None or not all(rides(order) for order in orders):
        return None
    return loose(bus, question, orders[0] if orders else None)
