"""What one cycle of a loop brought: where the axes are, who was not heard, and how old each position is."""

from __future__ import annotations

from collections.abc import Callable, Mapping


class LoopState:
    """What one cycle of a loop brought.

    `at`        when the readings were in, s of robot time
    `number`    of its slot on the grid of the loop; slots that were skipped are missing
    `position`  where each axis is (rad, m) by name, as it was heard last
    `missing`   the names of those that were not heard in this cycle
    `age`       how old the position of each is at that moment, s by name: buses do not answer at the same time
    """

    __slots__ = ("_ages", "at", "missing", "number", "position")

    def __init__(
        self,
        at: float,
        number: int,
        position: Mapping[str, float],
        missing: frozenset[str],
        ages: Callable[[float], dict[str, float]],
    ) -> None:
        self.at = at
        self.number = number
        self.position = position
        self.missing = missing
        self._ages = ages

    @property
    def age(self) -> dict[str, float]:
        """How old the position of each axis is (s), by name."""
        ages = self._ages(self.at)
        return {name: ages[name] for name in self.position}

    def __repr__(self) -> str:
        silent = f", missing {', '.join(sorted(self.missing))}" if self.missing else ""
        return f"<LoopState {self.number} at {self.at:.6g} s{silent}>"
