"""Flash of one simulated servo, as a function of time."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf


class Flash:
    """Stored raw values by name. A save takes time; the last complete one counts."""

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

    def cut(self, at: float, kept: str) -> None:
        """The supply goes: an incomplete save has stored nothing (`kept` "old") or everything ("new")."""
        self._stored = self._pending = self._pending if kept == "new" else self.stored(at)
        self._done = -inf
