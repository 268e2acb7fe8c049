"""What was handed over to devices to be obeyed later: whoever lets it begin is judged by it, and where all stand then.

It waits in the device and not in a program, so anybody on the bus may let it begin. What an earlier program handed over
nobody here knows.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.setpoint import Deferred, Setpoint


class Handed(NamedTuple):
    """Something that was handed over, or let begin; how often its node had been stopped by then."""

    later: Deferred
    goals: tuple[Setpoint, ...]
    stops: int


class Waiting:
    """What may wait in the nodes of one bus, as far as it was handed over while this was kept."""

    def __init__(self) -> None:
        self._of: Final[dict[int, tuple[Handed, ...]]] = {}

    def copy(self) -> Waiting:
        """The same, which knows nothing of what is handed over to the other one from now on."""
        found = Waiting()
        found._of.update(self._of)
        return found

    def take(self, later: Deferred, goals: tuple[Setpoint, ...], stops: int) -> None:
        """Something leaves for a node, to wait there."""
        assert later.node is not None
        before, later.done = self._left(later.node), False
        self._of[later.node] = (*before, Handed(later, goals, stops))

    def begin(self, later: Deferred) -> None:
        """What waits is told to begin. Until that is acknowledged it may have been lost, and wait still."""
        before = {node: self._left(node) for node in self._nodes(later)}
        later.done = False
        for node, left in before.items():
            if left:
                self._of[node] = (*left, Handed(later, (), 0))

    def of(self, later: Deferred) -> list[Handed] | None:
        """All that would begin; None when nobody knows of anything that waits there."""
        found = [one for node in self._nodes(later) for one in self._left(node)]
        return found or None

    def _nodes(self, later: Deferred) -> list[int]:
        return list(self._of) if later.node is None else [later.node]

    def _left(self, node: int) -> tuple[Handed, ...]:
        """From the last that was acknowledged on: whether what came after it has arrived, nobody knows yet."""
        left: tuple[Handed, ...] = ()
        for one in self._of.get(node, ()):
            done, begins = one.later.done, one.later.begins
            left = (() if begins else (one,)) if done else (*left, one)
        self._of[node] = left
        return left
