"""How a device that moves by a profile of its own keeps time with others, and what it says of its movement.

Such a device is not led: it is told a whole way at once, and tells nothing while it goes. See `keep_time` of
`core.family.Family.axis`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from motorbus.core.operation import Operation


class Timing(Protocol):
    """How a device that moves by a profile of its own keeps time with others, which may be on other buses."""

    def agreed(self, shortest: float, fitted: Callable[[float], float]) -> Operation[float]:
        """How long (s) all take, once each has said how long it takes at least: never less than `shortest`.

        `fitted` gives, for a duration that others need, the nearest one, not shorter, that this device can have.
        Raises Interrupted when somebody cannot take part.
        """

    def start(self, lead: float) -> Operation[float]:
        """It is ready. Comes back `lead` s before the common start, and gives that moment (s on this link's clock).

        Raises Interrupted when somebody cannot take part.
        """

    def fails(self, error: BaseException) -> None:
        """It does not begin, or has not come to its end, for this error: to be said at once, before cleaning up, so
        that the others do not go on meanwhile.
        """


class Turned(NamedTuple):
    """A movement that a device made by its own profile: all *estimated*, for nothing told of it.

    `angle` (rad, with its sign) is the whole way, which began at the moment `start` (s on the link's clock) and took
    `duration` (s). `way` says how much of it was done so many s after the start (rad, with its sign).
    """

    node: int
    angle: float
    start: float
    duration: float
    way: Callable[[float], float]
