"""What simulated devices remark, as lines for whoever watches a simulation, and not too many of them.

A device tells its host little: of a wrong checksum, nothing; of a number out of range, nothing. A simulated one can say
so to a person meanwhile. A host that repeats its mistake a thousand times a second is told of once in a while.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import Remark, Simulator

MOST: Final = 5
"""Lines in any second; what is beyond is counted."""


class Remarks:
    """The remarks of every node that keeps a `log`, from now on."""

    def __init__(self, simulator: Simulator) -> None:
        self._nodes = [(id, node) for id, node in sorted(simulator.nodes.items()) if hasattr(node, "log")]
        self._seen = dict.fromkeys((id for id, _ in self._nodes), 0)
        self._since = 0.0
        self._shown = 0
        self._left = 0

    def lines(self, now: float) -> list[str]:
        """What is to be shown at this moment (s, on any clock); call it now and then, also when nothing happens."""
        found: list[str] = []
        if now - self._since >= 1.0:
            found += self.rest()
            self._since, self._shown = now, 0
        for id, node in self._nodes:
            found += self._fresh(id, node.log)
        return found

    def rest(self) -> list[str]:
        """How many have not been shown; nothing when none."""
        left, self._left = self._left, 0
        return [f"… and {left} more"] if left else []

    def _fresh(self, id: int, log: list[Remark]) -> list[str]:
        if not log or log[-1].number == self._seen[id]:
            return []
        fresh = [remark for remark in log if remark.number > self._seen[id]]
        room = fresh[: max(0, MOST - self._shown)]
        self._shown += len(room)
        self._left += log[-1].number - self._seen[id] - len(room)
        self._seen[id] = log[-1].number
        return [f"{remark.at:9.3f} s  #{id}: {remark.text}" for remark in room]
