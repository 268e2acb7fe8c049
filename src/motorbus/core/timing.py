"""Synchronised start of devices that move by a profile of their own, and the record of such a movement.

Such a device takes the whole movement in one order and reports nothing while it moves. See `keep_time` in
`core.family.AxisDriver`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from motorbus.core.steps import Procedure


class Timing(Protocol):
    """Synchronises one device with others, which may be on other buses."""

    def agreed(self, shortest: float, fitted: Callable[[float], float]) -> Procedure[float]:
        """Return the common duration (s), at least `shortest`, once every device has given its minimum.

        `fitted` maps a duration that the others need to the nearest one, not shorter, that this device supports.
        Raises Interrupted if one of the devices cannot take part.
        """

    def start(self, lead: float) -> Procedure[float]:
        """Report this device ready. Return `lead` s before the common start; the value is that start (s, link clock).

        Raises Interrupted if one of the devices cannot take part.
        """

    def fails(self, error: BaseException) -> None:
        """Report that the movement does not start, or did not complete, because of `error`.

        Call it before any clean-up, so that the other devices do not continue meanwhile.
        """


class Turned(NamedTuple):
    """A movement that a device made by its own profile. All values are *estimates*: the device reports none.

    `angle` is the whole signed movement (rad), `start` the moment it began (s, link clock), `duration` in s. `way`
    maps the time since the start (s) to the signed angle done by then (rad).
    """

    node: int
    angle: float
    start: float
    duration: float
    way: Callable[[float], float]
