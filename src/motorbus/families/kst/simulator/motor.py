"""Flash and shaft of one simulated servo, as functions of time."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from motorbus.core.plant import move, rest


class Flash:
    """Stored raw values by name. A save takes time; a restart loads the last save that was complete."""

    def __init__(self, values: Mapping[str, int]) -> None:
        self._stored = dict(values)
        self._pending = self._stored
        self._begun = self._done = -inf

    def save(self, values: Mapping[str, int], at: float, duration: float) -> None:
        """Start to store these values."""
        self._stored = self.stored(at)
        self._pending = {name: values[name] for name in self._stored}
        self._begun, self._done = at, at + duration

    def saving(self, at: float) -> bool:
        """A save is running."""
        return at < self._done

    def midway(self, at: float) -> float:
        """Time (s) at which half of the save is done; inf without one."""
        return (self._begun + self._done) / 2 if self.saving(at) else inf

    def stored(self, at: float) -> dict[str, int]:
        """The values of the last complete save."""
        return self._stored if self.saving(at) else self._pending

    def load(self, at: float, *, cut: str) -> dict[str, int]:
        """The stored values; an incomplete save has stored nothing (`cut` "old") or everything ("new")."""
        self._stored = self._pending = self._pending if cut == "new" else self.stored(at)
        self._done = -inf
        return self._stored


class Shaft:
    """A shaft in raw counts. `zero` is the place that reads 0; in the reversed state readings change their sign."""

    def __init__(self, at: float, position: int, *, speed: float, acceleration: float) -> None:
        self.motion = rest(at, position)
        self.zero = 0
        self.reversed = False
        self._speed = speed
        self._acceleration = acceleration

    def reading(self, at: float) -> int:
        """Present position: a whole number of counts that fits 16 bits."""
        counts = round(self.motion.position(at)) - self.zero
        return max(-32768, min(32767, -counts if self.reversed else counts))

    def place(self, raw: int) -> int:
        """The place with this reading."""
        return self.zero + (-raw if self.reversed else raw)

    def move(self, raw: int, at: float) -> None:
        """Move to this reading, from the present motion."""
        position, velocity, _ = self.motion.state(at)
        self.motion = move(
            at,
            position,
            self.place(raw),
            velocity=velocity,
            speed=self._speed,
            acceleration=self._acceleration,
        )

    def halt(self, at: float) -> None:
        """Stand still, as without supply."""
        self.motion = rest(at, self.motion.position(at))

    def set_zero(self, at: float) -> None:
        """Read 0 here."""
        self.zero = round(self.motion.position(at))
        self.motion = rest(at, self.zero)
