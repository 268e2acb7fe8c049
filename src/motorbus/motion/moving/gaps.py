"""How long the host left axes without a goal: nobody who is led may be blamed for that."""

from __future__ import annotations

from math import inf
from typing import Final

LONG: Final = 0.15
"""s without a goal that an axis is seen to be behind by: half of what it may be behind where the host is in time."""
MEMORY: Final = 1.0
"""s after such a time for which an axis may still be behind because of it."""


class Gaps:
    """When goals leave that should do so every `period` s; all times are s by the clock of the link."""

    def __init__(self, period: float) -> None:
        self._long: Final = max(LONG, 3 * period)
        self._left = self._ended = -inf
        self._last = 0.0

    def left(self, now: float) -> None:
        """A goal has left."""
        gap = now - self._left
        if self._long < gap < inf:
            self._last, self._ended = gap, now
        self._left = now

    def lately(self, now: float) -> float:
        """s for which nobody was told where to go, by now or not long ago; 0.0 where that was never for long."""
        gap = now - self._left
        if self._long < gap < inf:
            return gap
        return self._last if now - self._ended <= MEMORY else 0.0
