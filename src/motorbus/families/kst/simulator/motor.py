"""Flash and shaft of one simulated servo, as functions of time."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final

from motorbus.core.plant import Motion, move, rest

STORED: Final = (
    "node_id",
    "bit_rate_code",
    "mid_point",
    "negative_limit",
    "positive_limit",
    "function_enable",
    "zero",
)
"""What a save keeps: "node id, bit rate, etc." (manual, command 3); travel limits and function byte by a public
flight-controller driver, the mid point by a public demo of a newer protocol; never the target position. `zero` is the
place of the shaft that a mid point sets."""


class Flash:
    """Stored raw values by name. A save takes time; a restart loads the last save that was complete."""

    def __init__(self, factory: Mapping[str, int]) -> None:
        self._stored = {name: raw for name, raw in factory.items() if name in STORED}
        self._saving: dict[str, int] | None = None
        self._begun = self._done = 0.0

    def save(self, values: Mapping[str, int], at: float, duration: float) -> None:
        """Start to store these values."""
        self._complete(at)
        self._saving = {name: values[name] for name in self._stored}
        self._begun, self._done = at, at + duration
        self._complete(at)

    def saving(self, at: float) -> bool:
        """A save is running."""
        self._complete(at)
        return self._saving is not None

    def midway(self, at: float) -> float:
        """Time (s) at which half of the save is done; inf without one."""
        return (self._begun + self._done) / 2 if self.saving(at) else inf

    def load(self, at: float, *, cut: str) -> dict[str, int]:
        """The stored values; an incomplete save has stored nothing (`cut` "old") or everything ("new")."""
        self._complete(at)
        if self._saving is not None and cut == "new":
            self._stored = self._saving
        self._saving = None
        return dict(self._stored)

    def stored(self, at: float) -> dict[str, int]:
        """The values that a restart would load at this time."""
        self._complete(at)
        return dict(self._stored)

    def _complete(self, at: float) -> None:
        if self._saving is not None and at >= self._done:
            self._stored, self._saving = self._saving, None


class Shaft:
    """A shaft in raw counts. `zero` is the place that reads 0; in the reversed state readings change their sign."""

    def __init__(self, at: float, position: int, *, speed: float, acceleration: float) -> None:
        self.motion: Motion = rest(at, position)
        self.zero = 0
        self.reversed = False
        self._speed = speed
        self._acceleration = acceleration

    def reading(self, at: float) -> int:
        """Present position: a whole number of counts that fits 16 bits."""
        counts = round(self.motion.position(at)) - self.zero
        return max(-32768, min(32767, -counts if self.reversed else counts))

    def move(self, raw: int, at: float) -> None:
        """Move to this reading, from the present motion."""
        self.motion = move(
            at,
            self.motion.position(at),
            self._place(raw),
            velocity=self.motion.velocity(at),
            speed=self._speed,
            acceleration=self._acceleration,
        )

    def halt(self, at: float) -> None:
        """Stand still, as without supply."""
        self.motion = rest(at, self.motion.position(at))

    def turn_by_hand(self, raw: int, at: float) -> None:
        """Stand at this reading."""
        self.motion = rest(at, self._place(raw))

    def set_zero(self, at: float) -> None:
        """Read 0 here."""
        self.zero = round(self.motion.position(at))
        self.turn_by_hand(0, at)

    def _place(self, raw: int) -> int:
        return self.zero + (-raw if self.reversed else raw)
