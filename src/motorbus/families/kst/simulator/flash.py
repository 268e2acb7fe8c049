"""Flash of one simulated servo, as a function of time."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf


class Flash:
    """Stored raw values by name. A save takes time; another one during it replaces it. Times never decrease."""

    def __init__(self, values: Mapping[str, int]) -> None:
        self._before = dict(values)
        self._after = self._before
        self._begun = self._done = -inf

    def save(self, values: Mapping[str, int], at: float, duration: float) -> None:
        """Start to store these values."""
        self._before = self.stored(at)
        self._after = {name: values[name] for name in self._before}
        self._begun, self._done = at, at + duration

    def saving(self, at: float) -> bool:
        """A save is running."""
        return at < self._done

    def midway(self, at: float) -> float:
        """Time (s) at which half of the save is done; inf without one."""
        return (self._begun + self._done) / 2 if self.saving(at) else inf

    def stored(self, at: float) -> dict[str, int]:
        """The values of the last complete save."""
        return self._before if self.saving(at) else self._after

    def lose_power(self, at: float, kept: str) -> None:
        """An incomplete save has stored nothing (`kept` "old") or everything ("new")."""
        self._before = self._after = self._after if kept == "new" else self.stored(at)
        self._done = -inf
